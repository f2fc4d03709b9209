"""How well two series go together."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from weighbridge.signals.signal import Floats


def inner(a: Floats, b: Floats) -> float:
    """Sum of the products of two series (n,).

    NumPy's ``a @ b`` uses threads where the series are long. On a busy machine these wait for each
    other longer than they work, and the last bits of the sum hang on their number.
    """
    return float(np.einsum("i,i", a, b))


def correlation(a: Floats, b: Floats) -> float:
    """Correlation of two series (n,) [-]; 0 where one of them does not vary."""
    return float(correlations(a, [b])[0])


def correlations(reference: Floats, series: Iterable[Floats]) -> Floats:
    """Correlation of a series (n,) with each of several (n,) [-].

    Returns
    -------
    (k,) 0 where one of the two does not vary
    """
    a = reference - reference.mean()
    power = inner(a, a)
    found = []
    for one in series:
        b = one - one.mean()
        size = np.sqrt(power * inner(b, b))
        found.append(inner(a, b) / size if size > 0.0 else 0.0)
    return np.array(found)
