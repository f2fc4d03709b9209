"""How wide the intervals are, and how wide they need be, from the table of the corpus.

``python studies/width.py`` writes ``studies/width.md``.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

import numpy as np
import polars as pl
from pages import filled

HERE: Final = Path(__file__).parent
TABLE: Final = HERE / "corpus" / "corpus.csv"
PAGE: Final = HERE / "width.md"

GROUPS: Final = {
    "cars and vans, inertial sensor, GNSS": r"^sound: (full|fixes every 5 s)$",
    "cars and vans, inertial sensor alone": r"^sound: no GNSS$",
    "cars and vans, inertial sensor, OBD at 1 Hz": r"^sound: IMU 50 Hz, OBD 1 Hz$",
    "cars and vans, inertial sensor at 10 or 20 Hz": r"^sound: IMU (10|20) Hz$",
    "cars and vans, one axis": r"^sound: one axis$",
    "cars and vans, GNSS, no inertial sensor": r"^sound: no IMU$",
    "cars and vans, GNSS, no inertial sensor, OBD at 1 Hz": r"^sound: no IMU, OBD 1 Hz$",
    "trucks and buses, inertial sensor": r"^sound: (full|no GNSS|fixes.*|IMU [125].*) \(truck\)$",
    "trucks and buses, no inertial sensor": r"^sound: no IMU.* \(truck\)$",
    "300 s, inertial sensor": r"^cut of 300 s: (full|no GNSS)$",
    "every gearbox, inertial sensor": r"^gearbox: (full|IMU 50 Hz, OBD 1 Hz)$",
    "foreign cars, inertial sensor": r"^foreign: (full|no GNSS|fixes.*|IMU .*)$",
    "foreign, no inertial sensor": r"^foreign: no IMU.*$",
}
"""Slices of undamaged drives, as patterns."""

FAR: Final = 0.05
"""Error beyond which a mass is far off [-]."""

HALF: Final = 1.96
"""Half of a 95 % interval [standard deviations]."""


def interval_score(error: np.ndarray, half: np.ndarray) -> float:
    """Mean interval score of 95 % intervals (Gneiting and Raftery 2007, eq. 43)."""
    return float(np.mean(2.0 * half + 40.0 * np.maximum(np.abs(error) - half, 0.0)))


def best_constant(error: np.ndarray) -> float:
    """Score of the best constant width, which only who knows the errors can choose."""
    # It is that of one of the errors: between them the score is a straight line.
    return min(interval_score(error, np.full(error.size, h)) for h in np.abs(error))


def parts(error: np.ndarray, vehicle: np.ndarray) -> tuple[float, float]:
    """RMS of what the drives of a vehicle share, and of what they do not."""
    means, spread, many = [], [], []
    for name in np.unique(vehicle):
        own = error[vehicle == name]
        if own.size > 1:
            means.append(np.mean(own))
            spread.append(np.var(own, ddof=1))
            many.append(own.size)
    within = float(np.average(spread, weights=np.array(many) - 1.0))
    shared = float(np.mean(np.square(means) - within / np.array(many)))
    return float(np.sqrt(max(shared, 0.0))), float(np.sqrt(within))


def rows() -> list[str]:
    table = pl.read_csv(TABLE, infer_schema_length=None).filter(
        (pl.col("status") == "converged") & pl.col("true_kg").is_not_null()
    )
    lines = []
    for group, pattern in GROUPS.items():
        chosen = table.filter(pl.col("slice").str.contains(pattern))
        error = (chosen["mass_kg"] / chosen["true_kg"] - 1.0).to_numpy()
        std = (chosen["std_kg"] / chosen["true_kg"]).to_numpy()
        vehicle = chosen["id"].str.extract(r"^([^/]*)").to_numpy()
        shared, own = parts(error, vehicle)
        scores = interval_score(error, HALF * std) / best_constant(error)
        lines.append(
            f"| {group} | {error.size} of {len(np.unique(vehicle))} "
            f"| {100.0 * np.sqrt(np.mean(error**2)):.2f} | {100.0 * shared:.2f} "
            f"| {100.0 * own:.2f} | {100.0 * np.sqrt(np.mean(std**2)):.2f} "
            f"| {np.mean((error / std) ** 2):.2f} | {np.mean(np.abs(error) < HALF * std):.0%} "
            f"| {scores:.2f} |"
        )
    return lines


def far_off() -> str:
    """Say how many undamaged drives are far off, and how many of them beyond their interval."""
    table = pl.read_csv(TABLE, infer_schema_length=None).filter(
        pl.col("sound") & (pl.col("status") == "converged") & pl.col("true_kg").is_not_null()
    )
    off = (table["mass_kg"] - table["true_kg"]).abs()
    far = off > FAR * table["true_kg"]
    beyond = far & (off > HALF * table["std_kg"])
    return f"{far.sum()} of {table.height}, {beyond.sum()} of them beyond their interval"


def page() -> str:
    figures = {"rows": "\n".join(rows()), "far": far_off()}
    return filled(HERE / "width.template.md", figures)


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
