"""Figures that the items of Galvão et al. ask for, by name."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from weighbridge.estimators.speed_ekf import FilterRun, mean_mass
from weighbridge.papers.claims import Found, same
from weighbridge.papers.galvao_equations import equations
from weighbridge.papers.galvao_results import Reproduction, Test
from weighbridge.papers.galvao_torque import BOUND, torque_figures

PAPER_WORST: Final = 0.0033
"""Largest error of Table 1 [-]."""

PAPER_BANDS: Final = (100.0, 200.0, 200.0)
"""Table 2 [kg]."""

LINE: Final = 0.5
"""Width of a line in a drawing of speeds up to 25 m/s [m/s]."""

CONVERGED: Final = 300.0
"""Time in which the paper's mass converges [s] (sec. 5.3)."""


def item_figures(done: Reproduction) -> dict[str, Found]:
    """Figures that the paper's items ask for."""
    found = equations() | of_tests(done.tests)
    return found | torque_figures(done.torque) | {"fig 4": _mean_mass()}


def of_tests(tests: Sequence[Test]) -> dict[str, Found]:
    """Figures of the three tests: figs. 7 to 15 and both tables."""
    found = {}
    for name, runs in (("", [t.ours for t in tests]), ("printed ", [t.printed for t in tests])):
        each = list(zip(tests, runs, strict=True))
        errors = [t.error(r) for t, r in each]
        bands = [t.band(r) for t, r in each]
        said = " / ".join(f"{100.0 * e:+.4f}" for e in errors)
        found[f"{name}errors"] = Found(
            f"errors {said} %", max(abs(e) for e in errors) <= PAPER_WORST
        )
        found[f"{name}bands"] = Found(
            f"± {' / '.join(f'{b:.0f}' for b in bands)} kg",
            all(b <= paper for b, paper in zip(bands, PAPER_BANDS, strict=True)),
        )
    for test in tests:
        late, end = _late_errors(test.printed, test)
        n = test.number
        found[f"late {n}"] = Found(f"{late:+.1f} %", abs(late) <= BOUND)
        found[f"end {n}"] = Found(f"{end:+.1f} %", abs(end) <= BOUND)
        off, explained = test.superimposed
        found[f"speed {n}"] = Found(
            f"off by {off:.2f} m/s RMS; R² of the speed {explained:.2f}", off <= LINE
        )
    return found


def _mean_mass() -> Found:
    """Average calm groups of a made course (fig. 4), step by step and by the code."""
    rng = np.random.default_rng(6)
    mass = 1100.0 + rng.normal(size=400) * np.repeat(rng.uniform(1.0, 30.0, 40), 10)
    last = mass[100:].reshape(10, 30)
    spread = np.sqrt(np.mean((last - last.mean(axis=1, keepdims=True)) ** 2, axis=1))
    return same(last[spread <= spread.mean()].mean(), mean_mass(mass, np.ones(400, dtype=bool)))


def _late_errors(run: FilterRun, test: Test) -> tuple[float, float]:
    """Error of the running mass after `CONVERGED` and at the end [%]."""
    time = test.balance.table.time[run.used]
    error = 100.0 * (run.mass[run.used] / test.mass - 1.0)
    return float(np.interp(time[0] + CONVERGED, time, error)), float(error[-1])
