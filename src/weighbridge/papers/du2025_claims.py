"""What the text of Du et al. 2025 says of its methods, and whether our drives say it too."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Final

import numpy as np

from weighbridge.papers.du2025_bus import LOADS
from weighbridge.papers.du2025_methods import BAND, METHODS, PAPER_RMSE, PAPER_TIME
from weighbridge.papers.du2025_results import (
    CONVERGED,
    DriveResult,
    Reproduction,
    RunningError,
    cell,
)
from weighbridge.signals import Floats

LEAST, KALMAN, BLEND = METHODS
EMPTY, HALF, FULL = LOADS

NEVER: Final = "never"

APPROXIMATELY: Final = 0.35
"""How far the paper's 2.7 times is from what it calls approximately twice [-]."""

Judge = Callable[[Reproduction, str], tuple[str, bool]]
"""Of all drives and the code of a `Form`: our figure, and whether the claim holds on them."""


def _running(done: Reproduction, form: str, method: str, load: str = "") -> list[RunningError]:
    return [d.printed_running[form][method] for d in done.drives if load in ("", d.load)]


def _mean(done: Reproduction, form: str, method: str, name: str, load: str = "") -> float:
    return float(np.mean([getattr(t, name) for t in _running(done, form, method, load)]))


def _by_speed(done: Reproduction, form: str, *, name: str, better: str) -> tuple[str, bool]:
    """Compare both filters below or above 40 km/h."""
    error = {m: _mean(done, form, m, name) for m in (LEAST, KALMAN)}
    other = KALMAN if better == LEAST else LEAST
    return (
        f"{error[LEAST]:.0f} by least squares, {error[KALMAN]:.0f} kg by the Kalman filter",
        bool(error[better] < error[other]),
    )


def _first(done: Reproduction, form: str) -> tuple[str, bool]:
    off = _mean(done, form, LEAST, "first", EMPTY)
    return f"{100.0 * off:.0f} %", off > BAND


def _moment(done: Reproduction, form: str, method: str, load: str) -> tuple[str, float]:
    """Say when a method came within the band for good, and when at the latest [s]."""
    last = max(float(d.tracks[method].time[-1] - d.tracks[method].time[0])
               for d in done.drives if d.load == load)  # fmt: skip
    at = np.array([t.steady_at for t in _running(done, form, method, load)])
    if np.max(at) >= last - 1.0:
        return NEVER, float("inf")
    return f"{np.mean(at):.0f} s", float(np.mean(at))


def _steady(done: Reproduction, form: str) -> tuple[str, bool]:
    said, at = _moment(done, form, LEAST, EMPTY)
    return said, at <= CONVERGED


def _sooner(done: Reproduction, form: str, *, load: str, factor: float) -> tuple[str, bool]:
    """Compare when both filters came within the band for good."""
    least, at = _moment(done, form, LEAST, load)
    kalman, other = _moment(done, form, KALMAN, load)
    return f"{kalman}; least squares {least}", bool(factor * other < at)


def _brakings(done: Reproduction, form: str, *, load: str) -> tuple[str, bool]:
    """Compare how far both filters move after the brakings in the cruise."""
    least, kalman = (_mean(done, form, m, "swing", load) for m in (LEAST, KALMAN))
    said = f"{100.0 * least:.1f} % of the mass against {100.0 * kalman:.1f} %"
    return said, least > 2.0 * kalman


def _unmoved(done: Reproduction, form: str) -> tuple[str, bool]:
    moved = _mean(done, form, KALMAN, "swing", EMPTY)
    return f"moves {100.0 * moved:.1f} %", moved < 0.005


def _rmse(done: Reproduction, form: str, load: str) -> tuple[float, ...]:
    """RMSE of the three methods at a load, in whole kg as they are printed."""
    return tuple(round(cell(done.drives, load, m, "printed", form).mean()) for m in METHODS)


def _blend(done: Reproduction, form: str, *, load: str) -> tuple[str, bool]:
    least, kalman, blend = _rmse(done, form, load)
    low, high = sorted((least, kalman))
    rank = (
        "better than both" if blend < low else
        "as the better one" if blend == low else
        "between them" if blend < high else
        "as the worse one" if blend == high else "worse than both"
    )  # fmt: skip
    return f"{blend:.0f} of {least:.0f} and {kalman:.0f} kg: {rank}", blend < low


def _blending(done: Reproduction, form: str) -> tuple[str, bool]:
    """Compare where h(v) is neither nothing nor all: below 40 km/h."""
    least, kalman, blend = (_mean(done, form, m, "slow") for m in METHODS)
    said = f"{blend:.0f} of {least:.0f} and {kalman:.0f} kg"
    return said, bool(blend < min(least, kalman))


def _loads(done: Reproduction, form: str) -> tuple[str, bool]:
    blends = [_rmse(done, form, load)[-1] for load in LOADS]
    return " / ".join(f"{x:.0f}" for x in blends) + " kg", max(blends) == blends[0]


def _twice(done: Reproduction, form: str) -> tuple[str, bool]:
    """Compare the mean RMSE of the loads with the paper's."""
    empty, half, full = (
        float(cell(done.drives, load, BLEND, "printed", form).mean()) for load in LOADS
    )
    theirs = [PAPER_RMSE[load][-1] / PAPER_RMSE[HALF][-1] for load in (EMPTY, FULL)]
    ours = [empty / half, full / half]
    near = all(abs(a / b - 1.0) <= APPROXIMATELY for a, b in zip(ours, theirs, strict=True))
    return f"{ours[0]:.1f} and {ours[1]:.1f} times", near


def _grows(done: Reproduction, form: str) -> tuple[str, bool]:
    early, late = (_mean(done, form, LEAST, name, HALF) for name in ("early", "late"))
    return f"from {early:.0f} to {late:.0f} kg", late > early


def _steadier(done: Reproduction, form: str) -> tuple[str, bool]:
    least, kalman, _ = _rmse(done, form, FULL)
    wander = [_mean(done, form, m, "wander", FULL) for m in (KALMAN, LEAST)]
    said = f"{kalman:.0f} of {least:.0f} kg; wanders by {wander[0]:.0f} of {wander[1]:.0f} kg"
    return said, kalman < least and wander[0] < wander[1]


def _largest(done: Reproduction, form: str) -> tuple[str, bool]:
    most = max(d.printed_worst[form][BLEND] for d in done.drives)
    return f"{100.0 * most:.1f} %", most < BAND


JUDGES: Final[dict[str, Judge]] = {
    "slow": partial(_by_speed, name="slow", better=LEAST),
    "fast": partial(_by_speed, name="fast", better=KALMAN),
    "blending": _blending,
    "first": _first,
    "steady": _steady,
    "sooner": partial(_sooner, load=EMPTY, factor=1.0),
    "braked": partial(_brakings, load=EMPTY),
    "unmoved": _unmoved,
    "loads": _loads,
    "sooner_half": partial(_sooner, load=HALF, factor=1.0),
    "braked_half": partial(_brakings, load=HALF),
    "grows": _grows,
    "twice": _twice,
    "slower_full": partial(_sooner, load=FULL, factor=1.5),
    "steadier": _steadier,
    "largest": _largest,
    **{f"blend {load}": partial(_blend, load=load) for load in LOADS},
}
"""What our drives say to each sentence of the text that a run can contradict, by the name of its
figure; all by the settings as printed."""


def mean_seconds(drives: tuple[DriveResult, ...]) -> Floats:
    """Return the mean processor time of a drive (3,), by `METHODS` [s]."""
    return np.array([np.mean([d.seconds[m] for d in drives]) for m in METHODS])


def paper_seconds() -> Floats:
    """Return the same of Table 2, mean of the loads [s]."""
    return np.asarray(np.mean([PAPER_TIME[load] for load in LOADS], axis=0))


def work(drives: tuple[DriveResult, ...]) -> tuple[str, bool]:
    """Compare processor time of the Kalman filter and of the hybrid with the least squares'."""
    seconds = mean_seconds(drives)
    kalman, blend = seconds[1:] / seconds[0]
    return _times(seconds), bool(1.0 < kalman < blend)


def paper_work() -> str:
    """Say the same of Table 2."""
    return _times(paper_seconds())


def _times(seconds: Floats) -> str:
    """Say how many times as long as the least squares the others take."""
    ratios = " and ".join(f"{x:.2f}" for x in seconds[1:] / seconds[0])
    return f"{ratios} times the least squares"
