"""What each check, correction and uncertainty of the program is worth: the corpus without it.

    python studies/ablation.py record            # weigh the corpus once, and note what acted in which pair
    python studies/ablation.py weigh [NAME ...]  # weigh again, without each, the pairs in which it acted
    python studies/ablation.py write             # write studies/ablation.md

A part that acts in no pair changes none, and needs no second run. To take a part out, its function runs as ever, and its
answer is replaced by the one in `NAMED`, as if it had found nothing.
"""  # noqa: E501

from __future__ import annotations

import dataclasses
import importlib
import json
import pkgutil
import sys
import zlib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from functools import wraps
from multiprocessing import get_context
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import polars as pl

ROOT: Final = Path(__file__).parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "studies")]

from studies.corpus.pairs import Pair, all_pairs, calibrated, unavailable  # noqa: E402
from studies.corpus.run import SCHEMA, Row, weigh  # noqa: E402
from studies.corpus.table import judged  # noqa: E402

import weighbridge  # noqa: E402
from weighbridge.errors import WeighbridgeError  # noqa: E402
from weighbridge.signals import Drive  # noqa: E402

KEPT: Final = ROOT / "build" / "ablation"
MOST: Final = 80
"""Pairs that are weighed again without a part [-]; drawn where it acts in more."""
MOST_VEHICLES: Final = 12
"""Vehicles that are calibrated again without a part [-]; drawn where it acts in more."""


def _nothing(found: Any, *given: Any) -> Any:
    return ()


def _none(found: Any, *given: Any) -> Any:
    return None


def _first(found: Any, *given: Any) -> Any:
    return given[0]


def _zero(found: Any, *given: Any) -> Any:
    return 0.0


def _false(found: Any, *given: Any) -> Any:
    return False if found is None or isinstance(found, bool) else np.zeros_like(found)


def _no_rows(found: Any, *given: Any) -> Any:
    return np.empty((0, 2))


def _empty(found: Any, *given: Any) -> Any:
    return []


def _vehicle_first(found: Any, drive: Any, vehicle: Any) -> Any:
    return vehicle, ()


def _vehicle_kept(found: Any, balance: Any, vehicle: Any) -> Any:
    return vehicle, None


def _not_another(found: Any, *given: Any) -> Any:
    return False, None


def _not_smoothed(found: Any, drive: Any, vehicle: Any, balance: Any) -> Any:
    return drive, (), balance


def _second(found: Any, drive: Any, vehicle: Any) -> Any:
    return vehicle


def _same_setup(found: Any, setup: Any, motion: Any, gain: Any) -> Any:
    return setup, motion


class Part(NamedTuple):
    """What can be taken out: a function of a module, and its answer if it had found nothing."""

    module: str
    name: str
    neutral: Callable[..., Any]


def _passed(found: Any, *given: Any) -> Any:
    from weighbridge.estimators.track import Status

    return Status.CONVERGED, None


NAMED: Final[tuple[tuple[Callable[..., Any], dict[str, str]], ...]] = (
    (_nothing, {
        "checks.clocks": "check_rates check_overlap check_pauses",
        "checks.second_signals": "check_reading check_second_signals compared",
        "checks.steps": "check_steps",
        "checks.inertial": "_check_gravity _check_rate _check_axes",
        "checks.speed": "_check_alone _check_positions",
        "checks.vehicle": "_check_reference _check_gears",
        "pipeline.notes": "unbacked other_equipment beside_speed overload beyond_class below_tare "
                          "lighter_than_known uncalibrated",
    }),
    (_none, {
        "checks.inertial": "_not_about_vertical _against_course _against_speed",
        "checks.speed": "_usual_gearing _gear_ratio _accel_ratio _beyond_belief",
        "balance.bandwidth": "smoothed_torque",
        "balance.shaking": "shaken",
        "balance.gear_scale": "scale_contradiction _changing",
        "balance.gear_fit": "share_on_gears",
        "balance.filled": "identify_fill",
        "balance.floor": "find_floor",
        "balance.second_signal": "lateness",
        "estimators.joint.changing": "largest",
        "estimators.joint.bend": "bent",
        "estimators.joint.contradicted": "contradicted",
        "estimators.joint.switched": "find_switched",
        "estimators.squat": "squat_by_speed",
        "navigation.identify.gain": "find_gain",
        "navigation.identify.alignment": "_check_speed_unit _nod",
        "navigation.identify.mounting": "_check_axes",
        "navigation.layout": "_check_found",
        "navigation.clock_lag": "find_offset",
        "navigation.clock_drift": "_broken",
        "calibration.charge": "in_their_air",
        "vehicle.power_balance": "find_power_balance",
        "balance.hybrid": "motor_helps",
        "checks.clocks": "_packets",
        "calibration.known_mass": "scale_finding fuel_finding drag_finding check_mass "
        "refuse_too_heavy",
        "calibration.joint": "_refuse_strange",
        "calibration.problem": "_refuse_foreign_gears",
        "calibration.run": "_refuse_useless unfound_gears",
        "calibration.fitted": "check_delay",
    }),
    (_first, {
        "signals.held": "without_repeats",
        "checks.derived": "without_derived",
        "checks.digits": "with_half_digits",
        "checks.spikes": "without_spikes",
        "checks.ranges": "without_strays within_ranges",
        "checks.smoothed_imu": "without_smoothed",
        "checks.correcting": "corrected _without_frozen _without_false _without_ends",
        "navigation.along": "with_forward_accel",
        "navigation.frozen": "without_frozen",
        "vehicle.as_read": "as_read",
        "estimators.squat": "of_vehicle",
        "estimators.joint.changing": "_without_launches",
        "estimators.joint.switched": "without_switched",
        "navigation.clock_drift": "correct_clocks _narrowed",
        "calibration.joint": "_with_dragged",
        "signals.timeline": "one_recording well_formed",
    }),
    (_zero, {
        "balance.coarse": "coarse_std",
        "balance.delay": "clock_shift",
        "balance.instants": "identify_engine_delay",
        "balance.force_balance": "_air_std",
        "estimators.joint.load_stops": "unseen_std",
        "estimators.joint.slow_errors": "inertia_relative_std",
        "estimators.joint.batch": "_air_std",
        "estimators.torque_shape": "shape_std",
        "estimators.considered": "fit_consider_std",
        "estimators.noisy_motion": "left_open",
        "estimators.judging": "cold_share uncalibrated_std grade_apart",
        "navigation.identify.alignment": "gnss_delay",
        "navigation.longitudinal": "_lateness",
        "calibration.uncertain_motion": "gain_std",
        "vehicle.power_balance": "_lateness",
    }),
    (_false, {
        "checks.false_samples": "isolated piled clipped",
        "checks.frozen": "frozen",
        "checks.steps": "_cleared",
        "navigation.dropouts": "false_rows _spikes _zeros",
        "navigation.identify.gain": "_upheld _smoothed",
        "balance.cornering": "cornering",
        "balance.filled": "filled",
        "balance.foot": "_pressed _noisy",
        "estimators.judging": "lacks_accelerometer",
        "navigation.identify.remounting": "_seen_by_gyro",
        "balance.braking": "_misses _braked _trailing retarder_unreported",
    }),
    (_empty, {
        "calibration.known_mass": "questionable_masses contradicting unbacked_scale",
        "calibration.uncertain_motion": "uncertain_gains",
        "calibration.run": "_mass_findings _balance_notes",
        "navigation.identify.remounting": "find_changes",
    }),
    (_passed, {
        "estimators.judging": "_enough_rows _narrow_enough _possible _long_enough _excited "
                              "_plausible",
    }),
    (_no_rows, {"navigation.frozen": "frozen_stretches"}),
    (_same_setup, {"navigation.identify.rounds": "_uncertain"}),
    (_second, {"balance.charge": "in_this_air"}),
    (_vehicle_first, {"vehicle.power_balance": "by_power"}),
    (_vehicle_kept, {"balance.circumference": "on_its_tyres"}),
    (_not_another, {"estimators.joint.foreign": "of_another"}),
    (_not_smoothed, {"balance.torque_drift": "smoothed_steps"}),
)  # fmt: skip
"""Functions by module, with the answer of each that found nothing."""


def _parts() -> dict[str, Part]:
    """List all parts by ``room.function``: those of `NAMED`, and each check of a drive."""
    from weighbridge import checks

    found = (check.find for check in checks.CHECKS.values())
    listed = [Part(f.__module__, f.__name__, _nothing) for f in found]
    for neutral, modules in NAMED:
        for module, names in modules.items():
            listed += [Part(f"weighbridge.{module}", name, neutral) for name in names.split()]
    return {f"{p.module.removeprefix('weighbridge.')}.{p.name}": p for p in listed}


def _load_all() -> None:
    for found in pkgutil.walk_packages(weighbridge.__path__, "weighbridge."):
        if not found.name.startswith(
            ("weighbridge.live", "weighbridge.cli", "weighbridge.__main__")
        ):
            try:
                importlib.import_module(found.name)
            except ImportError:  # An extra that is not installed.
                continue


def _same(a: Any, b: Any) -> bool:
    """Whether an answer is the neutral one."""
    if a is b:
        return True
    if isinstance(a, Drive) and isinstance(b, Drive):
        return (
            len(a.problems) == len(b.problems)
            and a.signals.keys() == b.signals.keys()
            and all(
                s is b.signals[n]
                or (
                    len(s) == len(b.signals[n])
                    and np.array_equal(s.values, b.signals[n].values)
                    and np.array_equal(s.time, b.signals[n].time)
                )
                for n, s in a.signals.items()
            )
        )
    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
        return np.shape(a) == np.shape(b) and bool(np.array_equal(a, b))
    if isinstance(a, (tuple, list)) and isinstance(b, (tuple, list)):
        return len(a) == len(b) and all(_same(x, y) for x, y in zip(a, b, strict=True))
    if dataclasses.is_dataclass(a) or dataclasses.is_dataclass(b):
        return False
    return bool(a == b)


ACTED: set[str] = set()
OFF: set[str] = set()


def _wrapped(key: str, part: Part, f: Callable[..., Any]) -> Callable[..., Any]:
    @wraps(f)
    def run(*given: Any, **named: Any) -> Any:
        refused: WeighbridgeError | None = None
        found: Any = None
        try:
            found = f(*given, **named)
            if hasattr(found, "__next__"):
                found = tuple(found)
        except WeighbridgeError as error:
            refused = error
        neutral = part.neutral(found, *given)
        if refused is not None or not _same(found, neutral):
            ACTED.add(key)
        if key in OFF:
            return neutral
        if refused is not None:
            raise refused
        return found

    return run


def install() -> None:
    """Put a switch around each part, wherever a module or the table of checks has it."""
    from weighbridge.checks import CHECKS

    _load_all()
    modules = [m for n, m in list(sys.modules.items()) if n.startswith("weighbridge") and m]
    for key, part in _parts().items():
        f = getattr(sys.modules[part.module], part.name)
        wrapped = _wrapped(key, part, f)
        for name, check in CHECKS._own.items():
            if check.find is f:
                CHECKS._own[name] = dataclasses.replace(check, find=wrapped)
        for module in modules:
            for name, value in list(vars(module).items()):
                if value is f:
                    setattr(module, name, wrapped)
                elif isinstance(value, tuple) and any(v is f for v in value):
                    setattr(module, name, tuple(wrapped if v is f else v for v in value))


@contextmanager
def without(*keys: str) -> Iterator[None]:
    """Take parts out for a while."""
    OFF.update(keys)
    try:
        yield
    finally:
        OFF.difference_update(keys)


def _calibrate(of: str, equipment: str) -> tuple[Any, list[str]]:
    ACTED.clear()
    try:
        vehicle: Any = calibrated(of, equipment)
    except WeighbridgeError as refused:
        vehicle = str(refused)
    return vehicle, sorted(ACTED)


def _record(of: str) -> list[dict[str, Any]]:
    """Weigh all pairs of a subject; say what acted in the calibration and in the weighing."""
    rows = []
    vehicles: dict[str, tuple[Any, list[str]]] = {}
    for pair in PAIRS:
        if pair.of != of:
            continue
        if pair.equipment and pair.equipment not in vehicles:
            vehicles[pair.equipment] = _calibrate(of, pair.equipment)
        vehicle, before = vehicles.get(pair.equipment, (None, []))
        ACTED.clear()
        row = weigh(pair, vehicle)
        rows.append({**dataclasses.asdict(row), "calibrating": before, "weighing": sorted(ACTED)})
    return rows


def _again(job: tuple[str, list[str], bool]) -> list[Row]:
    """Weigh pairs of one subject without a part."""
    key, ids, fresh = job
    rows, vehicles = [], {}
    for pair in (BY_ID[i] for i in ids):
        if pair.equipment and pair.equipment not in vehicles:
            vehicles[pair.equipment] = _vehicle(pair, key if fresh else None)
        with without(key):
            rows.append(weigh(pair, vehicles.get(pair.equipment)))
    return rows


KEPT_VEHICLES: dict[tuple[str, str], Any] = {}


def _vehicle(pair: Pair, key: str | None) -> Any:
    if key is None:
        at = (pair.of, pair.equipment)
        if at not in KEPT_VEHICLES:
            KEPT_VEHICLES[at] = _calibrate(*at)[0]
        return KEPT_VEHICLES[at]
    with without(key):
        return _calibrate(pair.of, pair.equipment)[0]


PAIRS: Final = [p for p in all_pairs() if not unavailable(p)]
BY_ID: Final = {p.id: p for p in PAIRS}


def _pool() -> ProcessPoolExecutor:
    return ProcessPoolExecutor(2, mp_context=get_context("fork"))


def record() -> None:
    """Weigh the corpus, and keep what acted."""
    KEPT.mkdir(parents=True, exist_ok=True)
    subjects = sorted({p.of for p in PAIRS}, key=lambda of: -sum(p.of == of for p in PAIRS))
    with _pool() as pool:
        rows = [row for part in pool.map(_record, subjects) for row in part]
    (KEPT / "record.json").write_text(json.dumps(rows))


def _drawn(values: list[str], most: int) -> list[str]:
    return sorted(values, key=lambda v: zlib.crc32(v.encode()))[:most]


def _plan(names: list[str]) -> list[tuple[str, list[str], bool]]:
    rows = json.loads((KEPT / "record.json").read_text())
    jobs = []
    for key in names or list(_parts()):
        acted = [
            r["id"] for r in rows if key in r["weighing"] and BY_ID[r["id"]].slice != "recorded"
        ]
        calibrating = {
            (BY_ID[r["id"]].of, BY_ID[r["id"]].equipment) for r in rows if key in r["calibrating"]
        }
        alone = [i for i in acted if (BY_ID[i].of, BY_ID[i].equipment) not in calibrating]
        chosen = set(_drawn(sorted("\t".join(v) for v in calibrating), MOST_VEHICLES))
        both = [
            r["id"]
            for r in rows
            if "\t".join((BY_ID[r["id"]].of, BY_ID[r["id"]].equipment)) in chosen
        ]
        for ids, fresh in ((_drawn(alone, MOST), False), (_drawn(both, MOST), True)):
            for of in sorted({BY_ID[i].of for i in ids}):
                jobs.append((key, [i for i in ids if BY_ID[i].of == of], fresh))
    return jobs


def weigh_without(names: list[str]) -> None:
    """Weigh again without each part, and keep the rows."""
    jobs = _plan(names)
    print(sum(len(j[1]) for j in jobs), "pairs", flush=True)
    # By subject: it is loaded once.
    jobs.sort(key=lambda j: (BY_ID[j[1][0]].of, j[0]))
    with _pool() as pool, (KEPT / "without.jsonl").open("a") as out:
        for job, rows in zip(jobs, pool.map(_again, jobs, chunksize=4), strict=True):
            for row in rows:
                out.write(json.dumps({"part": job[0], **dataclasses.asdict(row)}) + "\n")
            out.flush()


def _again_by_part() -> dict[str, dict[str, dict[str, Any]]]:
    path = KEPT / "without.jsonl"
    again: dict[str, dict[str, dict[str, Any]]] = {}
    for line in path.read_text().splitlines() if path.exists() else ():
        row = json.loads(line)
        again.setdefault(row.pop("part"), {})[row["id"]] = row
    return again


def _changes(before: list[dict[str, Any]], rows: dict[str, dict[str, Any]]) -> str:
    """Say what weighing without a part changed in the pairs weighed again."""
    then = judged(pl.DataFrame(before, schema=SCHEMA))
    now = judged(pl.DataFrame([rows.get(r["id"], r) for r in before], schema=SCHEMA))
    both = then.join(now, on="id", suffix="_after").filter(pl.col("id").is_in(list(rows)))

    def count(verdict: str) -> int:
        begun = (pl.col("verdict") != verdict) & (pl.col("verdict_after") == verdict)
        ended = (pl.col("verdict") == verdict) & (pl.col("verdict_after") != verdict)
        return both.filter(begun).height - both.filter(ended).height

    other = (pl.col("mass_kg") / pl.col("mass_kg_after") - 1.0).abs() > 1e-3
    moved = both.filter(other | (pl.col("verdict") != pl.col("verdict_after"))).height
    there = both.filter(pl.col("error").is_not_null() & pl.col("error_after").is_not_null())
    rms = [100.0 * float(np.sqrt(np.mean(there[n].to_numpy() ** 2))) if there.height else np.nan
           for n in ("error", "error_after")]  # fmt: skip
    cells = [len(rows), moved, *(f"{count(v):+d}" for v in ("silently wrong", "wrongly refused"))]
    return " | ".join(map(str, cells)) + f" | {rms[0]:.2f} → {rms[1]:.2f}"


def write() -> None:
    """Write the page: parts that act nowhere, what the others are worth, and what went."""
    whole = json.loads((KEPT / "record.json").read_text())
    before = [{k: r[k] for k in SCHEMA} for r in whole]
    again = _again_by_part()
    weighed = Counter(key for r in whole for key in r["weighing"])
    made = Counter(key for r in whole for key in r["calibrating"])
    parts = _parts()
    idle = [f"`{key}`" for key in parts if not weighed[key] + made[key]]

    def rows(keys: Iterable[str]) -> str:
        lines = []
        for key in sorted(keys, key=lambda key: (weighed[key] + made[key], key)):
            found = _changes(before, again[key]) if key in again else "| | | |".join(("", ""))
            lines.append(f"| `{key}` | {weighed[key]} | {made[key]} | {found} |\n")
        return "".join(lines)

    page = (ROOT / "studies" / "ablation.template.md").read_text(encoding="utf-8").format(
        pairs=len(whole),
        parts=len(parts),
        idle=len(idle),
        names="\n".join(f"- {name}" for name in idle),
        kept=rows(key for key in parts if weighed[key] + made[key]),
        gone=rows(again.keys() - parts.keys()),
    )  # fmt: skip
    (ROOT / "studies" / "ablation.md").write_text(page, encoding="utf-8")


if __name__ == "__main__":
    install()
    word, *names = sys.argv[1:] or ["write"]
    if word == "record":
        record()
    elif word == "weigh":
        weigh_without(names)
    else:
        write()
