"""The mass on the way: how soon it is how good, beside what the recorded drive gives at its end.

Run from the checkout: ``python studies/live.py``, which fills ``live.template.md`` and writes
``docs/live_figures.md``; with ``--check`` it compares them instead, and ends with 1 where they
differ. It takes the foreign simulator's drives in ``../shared/data`` where they are, and makes
vehicles of the second model with seeds that nothing else uses, in a folder that is removed. Each
drive is fed to a `LiveScale` second by second, as ``weighbridge live --replay --rate max`` does.
"""

from __future__ import annotations

import math
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
import polars as pl
from other_simulators import CALIBRATIONS, CLASSES, DRIVER, DRIVES, FOREIGN, KINDS, VEHICLES, masses
from pages import filled
from second_model import make_drive, random_vehicle

import weighbridge as wb
from weighbridge.errors import WeighbridgeError
from weighbridge.live.replay import FASTEST_BLOCK
from weighbridge.live.weighing import LiveStatus
from weighbridge.signals import LONGEST_STEP

HERE = Path(__file__).parent
PAGE = HERE.parent / "docs" / "live_figures.md"
JUDGED = 48200
LOADS = {"calibration-1": 0.0, "calibration-2": 0.45, "calibration-3": 0.9}
WEIGHED = {
    "drive-1": (0.95, "ordinary", 0.0),
    "drive-2": (0.3, "city", 0.0),
    "drive-3": (0.8, "ordinary", 0.5),
}
"""Part of the payload, style, and part of it that is unloaded on the way."""

MINUTES = (5.0, 10.0, 20.0)


@dataclass(frozen=True)
class Shown:
    """What a scale shows at one moment: mass, std and truth [kg], and its status."""

    mass: float
    std: float
    true: float
    status: str

    @property
    def error(self) -> float:
        return 100.0 * (self.mass / self.true - 1.0)

    @property
    def holds(self) -> bool:
        return abs(self.mass - self.true) <= 1.96 * self.std


@dataclass(frozen=True)
class Run:
    """One drive: what was shown after some minutes on the move, at the end, and by the batch.

    ``running`` is the mass just before the scale looks at all records once more, at the end, and
    ``first`` the first mass that is shown, after ``wait`` on the move [s].
    """

    name: str
    wait: float
    first: Shown | None
    after: dict[float, Shown]
    running: Shown
    end: Shown
    batch: float
    withdrawn: int


def run(name: str, folder: Path, car: wb.Vehicle) -> Run:
    """Feed one drive to a scale."""
    drive = wb.read_drive(folder)
    truth = pl.read_parquet(folder / "truth.parquet")
    time, mass = truth["time_s"].to_numpy(), truth["mass_kg"].to_numpy()
    scale = wb.LiveScale(car, info=drive.info, step=LONGEST_STEP)

    def shown() -> Shown:
        now = scale.weighing()
        at = now.time if math.isfinite(now.time) else scale.newest
        return Shown(now.mass, now.std, float(np.interp(at, time, mass)), str(now.status))

    after: dict[float, Shown] = {}
    first, wait = None, math.inf
    withdrawn = 0
    edges = drive.start + np.arange(0.0, drive.duration + 2.0 * FASTEST_BLOCK, FASTEST_BLOCK)
    for start, end in pairwise(edges.tolist()):
        part = drive.between(start, end)
        scale.update_block({n: (s.time, s.values) for n, s in part.signals.items()})
        now = scale.weighing()
        withdrawn += now.status is LiveStatus.INCONSISTENT
        if first is None and math.isfinite(now.mass):
            first, wait = shown(), now.driven
        for minutes in MINUTES:
            if minutes not in after and now.driven >= 60.0 * minutes:
                after[minutes] = shown()
    running = shown()
    scale.finish()
    try:
        batch = wb.weigh(drive, car)
        found = batch.segments[-1].mass if batch.load_changed else batch.mass
    except WeighbridgeError as error:
        print(f"{name}: {error}", file=sys.stderr)
        found = math.nan
    return Run(name, wait, first, after, running, shown(), found, withdrawn)


def calibrated(root: Path, base: wb.Vehicle | None) -> wb.Vehicle:
    names = CALIBRATIONS["three drives"]
    return wb.calibrate(
        [wb.read_drive(root / n) for n in names],
        [masses(root / n)[0] for n in names],
        vehicle=base,
    )


def foreign(vehicle: str) -> list[Run]:
    """Weigh the drives of one vehicle of the foreign simulator."""
    car = calibrated(FOREIGN / vehicle, None)
    return [run(f"{vehicle}, {n}", FOREIGN / vehicle / n, car) for n in DRIVES]


def second(number: int) -> list[Run]:
    """Make and weigh the drives of one vehicle of the second model."""
    kind = KINDS[number]
    vehicle = random_vehicle(kind, JUDGED + number)
    random = np.random.default_rng(17 * JUDGED + number)
    with tempfile.TemporaryDirectory() as made:
        root = Path(made)
        plan = {n: (part, "ordinary", 0.0) for n, part in LOADS.items()} | WEIGHED
        for name, (part, style, off) in plan.items():
            room = vehicle.gross - vehicle.tare - DRIVER
            make_drive(
                root / name, vehicle, mass=vehicle.tare + DRIVER + part * room,
                seed=int(random.integers(1 << 30)), style=style, unload=off * part * room,
            )  # fmt: skip
        try:
            car = calibrated(root, wb.Vehicle(name=kind, kind=CLASSES.get(kind, "car")))
        except WeighbridgeError as error:
            print(f"{kind}: {error}", file=sys.stderr)
            return []
        return [run(f"{kind}, {n}", root / n, car) for n in WEIGHED]


def share(flags: list[bool]) -> str:
    return f"{100.0 * np.mean(flags):.0f} %" if flags else "–"


def moments(runs: list[Run]) -> list[str]:
    """Tell how good the masses were after some minutes and at the end."""
    lines = [
        "|after|drives|with a mass|weighed|error RMS %|worst %|held by 95 %|median half width %|",
        "|---|---|---|---|---|---|---|---|",
    ]
    for title, all_shown in [
        ("the first mass", [r.first for r in runs if r.first is not None]),
        *(
            (f"{m:.0f} min on the move", [r.after[m] for r in runs if m in r.after])
            for m in MINUTES
        ),
        ("the end, before the last look", [r.running for r in runs]),
        ("the end", [r.end for r in runs]),
    ]:
        found = [t for t in all_shown if math.isfinite(t.mass)]
        errors = np.array([t.error for t in found])
        widths = [196.0 * t.std / t.mass for t in found]
        lines.append(
            f"|{title}|{len(all_shown)}|{len(found)}"
            f"|{sum(t.status == 'weighed' for t in found)}"
            f"|{np.sqrt(np.mean(errors**2)):.2f}|{errors[np.argmax(np.abs(errors))]:+.1f}"
            f"|{share([t.holds for t in found])}|{np.median(widths):.1f}|"
        )
    return lines


def first_mass(runs: list[Run]) -> str:
    """Say how soon the first mass comes, and how good it is."""
    wait = sorted(r.wait for r in runs)
    nine = wait[math.ceil(0.9 * len(wait)) - 1]
    near = [abs(r.first.error) <= 10.0 for r in runs if r.first is not None]
    return (
        f"The first mass comes after {np.median(wait):.0f} s on the move in the median, and within "
        f"{nine:.0f} s in nine of ten drives. {share(near)} of the first masses are within 10 % "
        "of the true one."
    )


def beside_batch(runs: list[Run]) -> str:
    both = [r for r in runs if math.isfinite(r.end.mass) and math.isfinite(r.batch)]
    apart = np.abs([100.0 * (r.end.mass / r.batch - 1.0) for r in both])
    before = np.abs([100.0 * (r.running.mass / r.batch - 1.0) for r in both])
    alone = [r.name for r in runs if math.isfinite(r.end.mass) != math.isfinite(r.batch)]
    text = (
        f"At the end live and recorded mass lie {np.median(apart):.2f} % apart (median of "
        f"{len(both)}); {share([a <= 0.3 for a in apart.tolist()])} within 0.3 %, the farthest "
        f"{apart.max():.2f} %. Just before that last look they lie {np.nanmedian(before):.2f} % "
        f"apart; {share([a <= 0.3 for a in before.tolist()])} within 0.3 %, the farthest "
        f"{np.nanmax(before):.2f} %."
    )
    if alone:
        text += f" Only one of the two has a mass in {len(alone)}: {'; '.join(alone)}."
    return text


def page(ours: list[Run], theirs: list[Run]) -> str:
    """Fill the template."""
    absent = "The drives are not here."
    values = {
        "second_first": first_mass(ours),
        "second_moments": "\n".join(moments(ours)),
        "second_batch": beside_batch(ours),
        "second_withdrawn": str(sum(r.withdrawn > 0 for r in ours)),
        "foreign_first": first_mass(theirs) if theirs else "",
        "foreign_moments": "\n".join(moments(theirs)) if theirs else absent,
        "foreign_batch": beside_batch(theirs) if theirs else "",
    }
    return filled(HERE / "live.template.md", values)


def main() -> int:
    """Write the page, or compare it."""
    with ProcessPoolExecutor(2) as pool:
        ours = [r for runs in pool.map(second, range(len(KINDS))) for r in runs]
        known = [v for v in VEHICLES if (FOREIGN / v).is_dir()]
        theirs = [r for runs in pool.map(foreign, known) for r in runs]
    text = page(ours, theirs)
    if "--check" in sys.argv[1:]:
        if text == PAGE.read_text(encoding="utf-8"):
            return 0
        print(f"{PAGE} is not what the program finds: run it without --check", file=sys.stderr)
        return 1
    PAGE.write_text(text, encoding="utf-8")
    print(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
