"""Figures that the items of Galvão et al. ask for, by name."""

from __future__ import annotations

from typing import Final

import numpy as np

from weighbridge.estimators.speed_ekf import FilterRun
from weighbridge.papers.galvao_bounds import speed_figures
from weighbridge.papers.galvao_results import Reproduction, Test
from weighbridge.papers.galvao_statistics import slope
from weighbridge.papers.galvao_torque import torque_figures

CONVERGED: Final = 300.0
"""Time in which the paper's mass converges [s] (sec. 5.3)."""


def item_figures(done: Reproduction) -> dict[str, str]:
    """Figures that the paper's items ask for: of the three tests."""
    found = {"r squared": f"{done.r_squared:.3f}"}
    for name, runs in (
        ("", [t.ours for t in done.tests]),
        ("printed ", [t.printed for t in done.tests]),
    ):
        tests = list(zip(done.tests, runs, strict=True))
        errors = " / ".join(f"{100.0 * t.error(r):+.4f}" for t, r in tests)
        found[f"{name}errors"] = f"errors {errors} %"
        found[f"{name}bands"] = f"± {' / '.join(f'{t.band(r):.0f}' for t, r in tests)} kg"
    late = [_late_errors(t.printed, t) for t in done.tests]
    found["printed late errors"] = (
        f"errors after 5 min {' / '.join(f'{a:+.0f}' for a, _ in late)} %, "
        f"at the end {' / '.join(f'{b:+.0f}' for _, b in late)} %"
    )
    return {
        **found,
        **torque_figures(done.torque),
        **speed_figures(done.says),
        "slope": "{:+.4f} ± {:.4f}".format(*slope(done.trials[-1].masses, done.trials[-1].answers)),
    }


def _late_errors(run: FilterRun, test: Test) -> tuple[float, float]:
    """Error of the running mass after `CONVERGED` and at the end [%]."""
    time = test.balance.table.time[run.used]
    error = 100.0 * (run.mass[run.used] / test.mass - 1.0)
    return float(np.interp(time[0] + CONVERGED, time, error)), float(error[-1])
