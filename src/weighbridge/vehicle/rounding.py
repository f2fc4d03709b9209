"""Numbers of a vehicle file in as many digits as their uncertainty leaves."""

from __future__ import annotations

import math
from dataclasses import fields
from typing import Any, Final

import numpy as np

from weighbridge.signals import UNITS
from weighbridge.signals.tomlfile import exact_text, rounded_text
from weighbridge.vehicle.file_keys import Key

BEYOND: Final = 3
"""Digits beyond the first of the standard deviation: what is fitted together is surer together."""

DIGITS: Final = 6
"""Significant digits where no standard deviation is known."""

STD_DIGITS: Final = 4
"""Significant digits of a standard deviation."""

COVARIANCE_DIGITS: Final = 6
"""Digits of a covariance, per product of the two standard deviations, at least."""

SHARE: Final = 0.01
"""Part of a covariance's smallest variance by which rounding may move any [-]."""

PINNED: Final = 1e-9
"""Variance of a correlation that is zero but for rounding [-]: a combination is known exactly."""

PINNED_DIGITS: Final = 8
"""Digits of such a covariance at least: that combination then moves by 0.0001 of what its parts
do, each by itself."""

_MOST_DIGITS: Final = 17
"""Digits that show any double (IEEE 754)."""


def rounded_texts(key: Key, part: Any, *, exact: bool) -> list[str]:
    """Write the number or numbers of a key.

    Parameters
    ----------
    key : of numbers
    part : what holds them, with their standard deviations where they are known
    exact : write them so that they load back to the last bit
    """
    value = getattr(part, key.field)
    values = value if isinstance(value, tuple) else (value,)
    suffix = key.suffix or "ratio"
    if exact:
        return [exact_text(v, suffix) for v in values]
    if key.field.endswith(("std", "stds")):
        return [rounded_text(v, suffix, digits=STD_DIGITS) for v in values]
    stds = _stds(key.field, part, len(values))
    return [_to_std(v, suffix, std) for v, std in zip(values, stds, strict=True)]


def covariance_texts(triangle: tuple[float, ...], *, exact: bool) -> list[str]:
    """Write the lower triangle of a covariance, row by row.

    As many digits as keep it a covariance: what is correlated nearly wholly needs more.
    """
    if exact:
        return [exact_text(v, "ratio") for v in triangle]
    size = math.isqrt(2 * len(triangle))
    rows, columns = np.tril_indices(size)
    cov = np.zeros((size, size))
    cov[rows, columns] = triangle
    std = np.sqrt(np.maximum(np.diag(cov), 0.0))
    scale = np.outer(std, std)[rows, columns]
    correlation = np.divide(cov[rows, columns], scale, where=scale > 0.0, out=np.zeros(rows.size))
    least, pinned = _smallest(correlation, rows, columns, std > 0.0)
    for digits in range(PINNED_DIGITS if pinned else COVARIANCE_DIGITS, _MOST_DIGITS):
        texts = [
            _to_step(v, s * 10.0**-digits) if s > 0.0 else exact_text(v, "ratio")
            for v, s in zip(triangle, scale, strict=True)
        ]
        if size * 10.0**-digits < SHARE * least:
            return texts
    return [exact_text(v, "ratio") for v in triangle]


def _smallest(correlation: Any, rows: Any, columns: Any, there: Any) -> tuple[float, bool]:
    """Smallest eigenvalue of a correlation that is not zero, and whether one is zero.

    Of the parameters that are there.
    """
    whole = np.zeros((there.size, there.size))
    whole[rows, columns] = whole[columns, rows] = correlation
    kept = whole[np.ix_(there, there)]
    values = np.linalg.eigvalsh(kept) if kept.size else np.zeros(0)
    free = values[values > PINNED]
    return float(free.min(initial=np.inf)), bool(free.size < values.size)


def _stds(field: str, part: Any, many: int) -> tuple[float, ...]:
    """Standard deviations of a field (many,); 0 where they are not known."""
    names = {f.name for f in fields(part)}
    axes = ("roll", "pitch", "yaw")
    if field in axes and "squat" in names and part.std is not None:
        return (float(part.std[axes.index(field)]),)
    for name in (f"{field}_std", f"{field.removesuffix('s')}_stds", f"{field}_stds"):
        found = getattr(part, name) if name in names else None
        if found is not None and found != ():
            return found if isinstance(found, tuple) else (float(found),)
    return (0.0,) * many


def _to_std(value: float, suffix: str, std: float) -> str:
    outside = abs(std / UNITS[suffix].factor)
    if not 0.0 < outside < math.inf:
        return rounded_text(value, suffix, digits=DIGITS)
    return rounded_text(value, suffix, step=10.0 ** (math.floor(math.log10(outside)) - BEYOND))


def _to_step(value: float, step: float) -> str:
    return rounded_text(value, "ratio", step=10.0 ** math.floor(math.log10(step)))
