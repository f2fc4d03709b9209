"""Weigh pairs, in several processes."""

from __future__ import annotations

import math
import multiprocessing
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, fields
from itertools import groupby
from typing import Any, Final

import polars as pl
from studies.corpus.pairs import Pair, calibrated
from studies.corpus.subjects import READ, subject

import weighbridge as wb
from weighbridge.errors import WeighbridgeError
from weighbridge.vehicle.model import Vehicle

WORKERS: Final = 2
TOGETHER: Final = 25
"""Pairs of one subject that a process takes at a time [-]."""


@dataclass(frozen=True)
class Row:
    """What came of a pair.

    Attributes
    ----------
    id, slice, sound, reference : as of `Pair`
    true_kg, mass_kg, std_kg : None where unknown
    status : of the weighing; ``error`` where the drive or its vehicle file was refused,
        ``traceback`` where the program broke
    problem_ids : of the weighing, by blanks
    """

    id: str
    slice: str
    sound: bool
    reference: str
    true_kg: float | None
    mass_kg: float | None
    std_kg: float | None
    status: str
    problem_ids: str


SCHEMA: Final[dict[str, type[pl.DataType]]] = {
    f.name: {"str": pl.String, "bool": pl.Boolean}.get(str(f.type), pl.Float64) for f in fields(Row)
}


def _rounded(value: float) -> float | None:
    return round(value, 1) if math.isfinite(value) else None


def weigh(pair: Pair, vehicle: Vehicle | str | None) -> Row:
    """Weigh one pair by its vehicle file; a sentence stands for one that was refused."""
    found = pair.id, pair.slice, pair.sound, pair.reference
    if isinstance(vehicle, str):
        return Row(*found, None, None, None, "error", "calibration")
    true: float | None = None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)
            made = pair.make(subject(pair.of) if pair.of else None, vehicle)  # type: ignore[arg-type]
            true = _rounded(made.true)
            w = wb.weigh(made.drive, made.vehicle)
    except WeighbridgeError as refused:
        why = refused.problem.id if refused.problem is not None else type(refused).__name__
        return Row(*found, true, None, None, "error", why)
    except Exception as broken:
        return Row(*found, true, None, None, "traceback", type(broken).__name__)
    ids = sorted({p.id for p in w.problems} | ({w.reason_id} if w.reason_id else set()))
    return Row(*found, true, _rounded(w.mass), _rounded(w.std), str(w.status), " ".join(ids))


def _calibrate(of: tuple[str, str]) -> Vehicle | str:
    try:
        return calibrated(*of)
    except WeighbridgeError as refused:
        return str(refused)


def _weigh_all(job: tuple[Sequence[Pair], dict[tuple[str, str], Vehicle | str]]) -> list[Row]:
    pairs, vehicles = job
    return [weigh(p, vehicles.get((p.of, p.equipment))) for p in pairs]


def _runs(pairs: Iterable[Pair]) -> Iterator[list[Pair]]:
    for _, group in groupby(sorted(pairs, key=lambda p: p.of), key=lambda p: p.of):
        run = list(group)
        for k in range(0, len(run), TOGETHER):
            yield run[k : k + TOGETHER]


def _shared_out(work: Callable[[Any], Any], jobs: Sequence[Any], workers: int) -> list[Any]:
    if workers == 1:
        return [work(job) for job in jobs]
    with ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("fork")) as pool:
        return list(pool.map(work, jobs))


def run(pairs: Sequence[Pair], workers: int = WORKERS) -> pl.DataFrame:
    """Calibrate and weigh in so many processes; rows are in the order of the pairs."""
    made = {p.of for p in pairs if p.of and p.of not in READ}
    _shared_out(_prepare, sorted(made), workers)
    wanted = sorted({(p.of, p.equipment) for p in pairs if p.equipment})
    vehicles = dict(zip(wanted, _shared_out(_calibrate, wanted, workers), strict=True))
    jobs = [
        (some, {k: v for k, v in vehicles.items() if k[0] == some[0].of}) for some in _runs(pairs)
    ]
    order = {p.id: k for k, p in enumerate(pairs)}
    rows = [row for part in _shared_out(_weigh_all, jobs, workers) for row in part]
    rows.sort(key=lambda row: order[row.id])
    return pl.DataFrame(rows, schema=SCHEMA, orient="row")


def _prepare(of: str) -> None:
    """Make a subject where it is not kept yet."""
    subject(of)
