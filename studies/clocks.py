"""Would one solve for the clocks of all tables change anything? Loops of lags, and GNSS moved.

``python studies/clocks.py`` writes ``studies/clocks.md`` from the undamaged drives of the corpus.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import numpy as np
import polars as pl
from pages import filled

HERE: Final = Path(__file__).parent
sys.path.insert(0, str(HERE.parent))

from studies.corpus.pairs import calibrated, seen_through  # noqa: E402
from studies.corpus.subjects import MADE, subject  # noqa: E402

import weighbridge as wb  # noqa: E402
from weighbridge.navigation.clock_drift import _gnss_speed  # noqa: E402
from weighbridge.navigation.clock_lag import Integrated, Lags, find_lags  # noqa: E402
from weighbridge.signals import QUANTITIES, Drive, Signal, find_lag  # noqa: E402

SPAN: Final = 2.0
"""Changes of the two speeds are compared over so long [s]."""

MOVED: Final = (0.0, -20.0, -5.0, 2.0, 5.0, 10.0, 20.0, 60.0)
"""By which GNSS is made late [s]."""

LIGHT: Final = 0.2 / 0.15
"""Mass per lateness of the whole bus [% per s]: 0.15 s is worth 0.2 %, of `balance.delay`."""


def _of_whole(lags: Lags) -> tuple[float, float]:
    """Lag of a drive and its standard deviation [s], from those of its pieces."""
    return float(np.median(lags.lag)), float(np.median(lags.std) / np.sqrt(lags.lag.size))


def _between(speed: Signal, ground: Signal) -> float:
    """By how much vehicle speed is later than speed over ground [s]."""
    start, end = max(speed.time[0], ground.time[0]), min(speed.time[-1], ground.time[-1])
    grid = np.arange(start + 6.0, end - 6.0, 0.1)

    def changes(s: Signal, at: np.ndarray) -> np.ndarray:
        return np.asarray(s.at(at + 0.5 * SPAN) - s.at(at - 0.5 * SPAN))

    known = changes(ground, grid)

    def misfit(lag: float) -> float:
        x = changes(speed, grid + lag)
        ok = np.isfinite(x) & np.isfinite(known)
        gain = float(x[ok] @ known[ok]) / float(x[ok] @ x[ok])
        return float(np.mean((known[ok] - gain * x[ok]) ** 2))

    return find_lag(misfit, -1.5, 2.0, farthest=3.0)


def loops() -> Iterator[tuple[str, str, float, float, float, float, float]]:
    """Lags of vehicle speed and GNSS against the accelerometer, stds, and misclosure [s]."""
    for name in MADE:
        for of, (drive, _) in subject(name).drives.items():
            speed, ground = drive.get("vehicle_speed"), _gnss_speed(drive)
            if speed is None or ground is None or not drive.has("accel_x"):
                continue
            force = Integrated.of([drive.signals[f"accel_{a}"] for a in "xyz"])
            bus, gnss = find_lags(force, speed), find_lags(force, ground)
            if min(bus.lag.size, gnss.lag.size) < 2:
                continue
            (late, late_std), (gnss_late, gnss_std) = _of_whole(bus), _of_whole(gnss)
            apart = late - gnss_late - _between(speed, ground)
            yield name, of, late, late_std, gnss_late, gnss_std, apart


def _later(drive: Drive, by: float) -> Drive:
    moved = (
        Signal(n, s.time + by, s.values)
        for n, s in drive.signals.items()
        if QUANTITIES[n].table == "gnss"
    )
    return drive.with_signals(*moved)


def moved() -> Iterator[str]:
    """Rows by lateness of GNSS without an inertial sensor: change and error of the mass."""
    found: dict[float, list[tuple[float, float, bool]]] = {by: [] for by in MOVED}
    drives = 0
    for name in MADE:
        vehicle = calibrated(name, "no IMU")
        for drive, true in subject(name).drives.values():
            seen = seen_through("no IMU", drive)
            usual = wb.weigh(seen, vehicle).mass
            drives += 1
            for by in MOVED:
                try:
                    other = wb.weigh(_later(seen, by), vehicle)
                except wb.errors.DriveError:
                    continue
                if np.isfinite(other.mass):
                    low, high = other.interval(0.95)
                    found[by].append((other.mass / usual, other.mass / true, low < true < high))
    for by, rows in found.items():
        change, error, holds = np.array(rows).T
        by_clock, all_in_all = (100.0 * np.sqrt(np.mean((x - 1.0) ** 2)) for x in (change, error))
        yield (
            f"| {by:+.0f} | {len(rows)} of {drives} | {by_clock:.1f} | {all_in_all:.1f} "
            f"| {np.mean(holds):.0%} |"
        )


def _of_corpus(what: str) -> dict[str, str]:
    """RMS and coverage of the pairs of the corpus with something off its clock."""
    table = pl.read_csv(HERE / "corpus" / "corpus.csv", infer_schema_length=None)
    rows = table.filter(pl.col("slice") == f"fault: {what} off the clock, no IMU")
    off = rows["mass_kg"] - rows["true_kg"]
    rms = 100.0 * float(np.sqrt(((off / rows["true_kg"]) ** 2).mean()))
    hold = float((off.abs() < 1.96 * rows["std_kg"]).mean())
    name = what.lower()
    return {name: f"{rms:.1f}", f"{name}_hold": f"{hold:.0%}"}


def page() -> str:
    """Return the page with its figures."""
    found = list(loops())
    rows = [
        f"| {name}, {of} | {late:.2f} ± {std:.3f} | {gnss:.2f} ± {gnss_std:.3f} | {apart:+.3f} |"
        for name, of, late, std, gnss, gnss_std, apart in found
    ]
    late_std, gnss_std, apart = np.array([(r[3], r[5], r[6]) for r in found]).T
    # Least squares closes a loop by each side's share of the variances; the third side is as
    # sure as that of GNSS, which both have in common.
    share = late_std**2 / (late_std**2 + 2.0 * gnss_std**2)
    by = float(np.sqrt(np.mean((share * apart) ** 2)))
    return filled(
        HERE / "clocks.template.md",
        _of_corpus("GNSS")
        | _of_corpus("heights")
        | {
            "loops": "\n".join(rows),
            "drives": str(len(found)),
            "misclosure": f"{np.sqrt(np.mean(apart**2)):.3f}",
            "most": f"{np.max(np.abs(apart)):.2f}",
            "by": f"{by:.4f}",
            "mass": f"{LIGHT * by:.4f}",
            "moved": "\n".join(moved()),
        },
    )


if __name__ == "__main__":
    (HERE / "clocks.md").write_text(page(), encoding="utf-8")
