"""Our figures beside those of Du et al. 2025: which fall behind, which are of other conditions."""

from __future__ import annotations

from typing import Final

import numpy as np

from weighbridge.papers.du2025_bus import LOADS
from weighbridge.papers.du2025_claims import (
    CLAIMS,
    mean_seconds,
    paper_seconds,
    paper_work,
    work,
)
from weighbridge.papers.du2025_methods import (
    BAND,
    METHODS,
    PAPER_RMSE,
    PRINTED_ROLLING,
)
from weighbridge.papers.du2025_results import Reproduction, cell
from weighbridge.papers.reproduced import Comparison
from weighbridge.signals import Floats

PRINTED: Final = next(iter(PRINTED_ROLLING))
"""The rolling coefficient of Table 1: the conditions of the paper."""


def comparisons(done: Reproduction) -> tuple[Comparison, ...]:
    """Put our figures beside the paper's: by its own settings first, then by ours."""
    return (
        *(row for form in PRINTED_ROLLING for row in _as_printed(done, form)),
        *(row for form in PRINTED_ROLLING for row in _by_text(done, form)),
        *_by_ours(done),
        *_seconds(done),
    )


def _as_printed(done: Reproduction, form: str) -> tuple[Comparison, ...]:
    """Rows of the filters as printed; told another rolling coefficient they know more."""
    like = form == PRINTED
    means = {
        load: [cell(done.drives, load, m, "printed", form).mean() for m in METHODS]
        for load in LOADS
    }
    return (
        *(
            Comparison(f"RMSE as printed, {form}, {load}, {', '.join(METHODS)}",
                       ", ".join(f"{x:.0f}" for x in theirs) + " kg",
                       ", ".join(f"{x:.0f}" for x in means[load]) + " kg",
                       bool(np.all(np.array(means[load]) <= theirs)), like)
            for load, theirs in PAPER_RMSE.items()
        ),
        _largest(f"as printed, {form}", [d.printed_worst[form] for d in done.drives], like=like),
        _order(f"as printed, {form}", np.mean(list(means.values()), axis=0), like=like),
    )  # fmt: skip


def _by_text(done: Reproduction, form: str) -> tuple[Comparison, ...]:
    """Rows of what the text says of the methods, by the filters as printed."""
    rows = []
    for each in CLAIMS:
        ours, so = each.judge(done, form)
        rows.append(Comparison(f"{each.item}, as printed, {form}", each.theirs, ours, so,
                               form == PRINTED, claim=True))  # fmt: skip
    return tuple(rows)


def _by_ours(done: Reproduction) -> tuple[Comparison, ...]:
    """Rows of our filters: told the tyres' rolling on the paper's drives, then on the road."""
    rows = []
    kinds = {
        "ours, told the tyres' rolling": done.drives,
        "ours, calibrated, with all effects": done.road,
    }
    for kind, drives in kinds.items():
        for load, theirs in PAPER_RMSE.items():
            for method, paper in zip(METHODS, theirs, strict=True):
                every = cell(drives, load, method, "late_rmse")
                rows.append(
                    Comparison(f"RMSE of {kind}, {load}, {method}", f"{paper:.0f} kg",
                               f"{every.mean():.0f} kg, worst drive {every.max():.0f} kg",
                               bool(every.mean() < paper), like_for_like=False)
                )  # fmt: skip
        means = np.array([np.mean([d.late_rmse[m] for d in drives]) for m in METHODS])
        rows.append(_largest(kind, [d.worst for d in drives], like=False))
        rows.append(_order(kind, means, like=False))
    return tuple(rows)


def _largest(kind: str, errors: list[dict[str, float]], *, like: bool) -> Comparison:
    largest = max(max(each.values()) for each in errors)
    return Comparison(f"largest error from 21 s on, all methods and drives, {kind}",
                      "below 10 %", f"{100.0 * largest:.1f} %", largest < BAND, like)  # fmt: skip


def _order(kind: str, means: Floats, *, like: bool) -> Comparison:
    """Say which method came out best [kg]; what is equal in whole kg breaks no order."""
    whole = np.round(means)
    order = sorted(zip(whole, METHODS, strict=True))
    return Comparison(f"order of merit, mean RMSE of all drives, {kind}",
                      "hybrid, ekf, robust-rls", ", ".join(f"{m} {x:.0f} kg" for x, m in order),
                      bool(np.all(np.diff(whole) <= 0.0)), like)  # fmt: skip


def _seconds(done: Reproduction) -> tuple[Comparison, ...]:
    """Compare processor time; another computer."""
    seconds, theirs = mean_seconds(done.drives), paper_seconds()
    said, so = work(done.drives)
    return (
        Comparison("computing time of a drive, " + ", ".join(METHODS),
                   ", ".join(f"{t:.1f}" for t in theirs) + " s",
                   ", ".join(f"{t:.3f}" for t in seconds) + " s",
                   bool(np.all(seconds < theirs)), like_for_like=False),
        Comparison("sec. 4.2, computing time of the Kalman filter and of the hybrid",
                   paper_work(), said, so, like_for_like=False, claim=True),
    )  # fmt: skip
