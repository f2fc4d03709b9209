"""How far a mass has come, and what would make it surer."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from scipy.special import ndtri

from weighbridge.live.weighing import LiveStatus

GOOD, BETTER = 0.05, 0.02
"""Half widths of the 95 % interval over the mass that are asked for [-]."""

_REACH: Final = float(ndtri(0.975))
"""Half width of the 95 % interval in standard deviations [-]."""

ADVICE: Final = (
    "starts, hills and changes of speed tell most; steady driving and braking tell little"
)
"""Which driving helps."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Outlook:
    """What a mass is worth and still needs; see `weighbridge.live.weighing.LiveWeighing`."""

    status: LiveStatus
    reason: str = ""
    progress: float = 0.0
    reach: float = math.nan
    minutes_to_5: float = math.nan
    minutes_to_2: float = math.nan
    advice: str = ""


def outlook(
    mass: float,
    std: float,
    floor: float,
    *,
    driven: float,
    reason: str,
    silent: Sequence[str],
    first: float,
) -> Outlook:
    """Judge a mass by its interval, and tell how much more driving it takes.

    Noise falls as one over the time on the move; what vehicle file and equipment leave does not.

    Parameters
    ----------
    mass, std : [kg]; NaN where there is none
    floor : part of ``std`` that no driving takes away, relative to the mass [-]
    driven : time on the move that the mass was made from [s]
    reason : why there is none
    silent : signals that are needed and do not come
    first : time on the move before which nothing is weighed [s]
    """
    missing = f"{', '.join(silent)} {'does' if len(silent) == 1 else 'do'} not come"
    if math.isnan(mass):
        if not reason:
            reason = f"driven {driven:.0f} s; the first mass takes {first:.0f} s on the move"
        return Outlook(
            status=LiveStatus.LEARNING,
            reason=f"{missing}; {reason}" if silent else reason,
            advice=ADVICE,
        )
    half = _REACH * std / mass
    noise = max(std**2 - (floor * mass) ** 2, 0.0)
    to_good = _minutes(GOOD, mass, noise, floor, driven)
    to_better = _minutes(BETTER, mass, noise, floor, driven)
    good = half <= GOOD
    if not good:
        reason = f"within {100.0 * half:.1f} % so far"
        reason = f"{missing}; {reason}" if silent else reason
    elif silent:
        reason = missing
    return Outlook(
        status=LiveStatus.WEIGHED if good and not silent else LiveStatus.LEARNING,
        reason="" if good and not silent else reason,
        progress=min(1.0, (BETTER / half) ** 2),
        reach=_REACH * floor,
        minutes_to_5=to_good,
        minutes_to_2=to_better,
        advice="" if to_better == 0.0 else ADVICE,
    )


def _allowed(half: float, mass: float, floor: float) -> float:
    """Variance of the noise with which the interval is as narrow [kg^2]; negative if never."""
    return (half * mass / _REACH) ** 2 - (floor * mass) ** 2


def _minutes(half: float, mass: float, noise: float, floor: float, driven: float) -> float:
    """Time on the move until the interval is as narrow [min]; NaN where there is no interval."""
    if math.isinf(noise):
        return math.nan
    allowed = _allowed(half, mass, floor)
    if noise <= allowed:
        return 0.0
    return driven / 60.0 * (noise / allowed - 1.0) if allowed > 0.0 else math.inf
