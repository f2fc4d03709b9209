"""Does the torque's reading still go with its second signals as in the calibration?"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np

from weighbridge.balance.second_signal import (
    BY_SIGNAL,
    LOAD_AIR,
    Means,
    air_of,
    compare,
    lateness,
    means,
    predicted_by,
    ranges_of,
    rows_of,
)
from weighbridge.limits import POSSIBLE, SOME
from weighbridge.messages import phrase
from weighbridge.signals import Drive
from weighbridge.vehicle import SecondSignalRelation, Vehicle

QUESTIONABLE: Final = 0.05
"""Scale, or level over the reading's range, off by more is questioned [-]."""

SERIOUS: Final = 0.09
"""The same, above which there is no mass [-]: the mass is off by 1.1 to 1.5 times as much."""

SURE: Final = 3.5
"""Standard deviations by which it has to be off for that, `POSSIBLE` to be questioned [-]. So 8 of
1184 pairs of calibration and drive of recorded vehicles were questioned (a petrol car's load by
intake pressure, another's torque by it, an electric car by its battery), and 2 refused beside those
with a trip whose torque repeats one value to its end."""

LEVEL_STD: Final = 0.02
"""Standard deviation of the level between drives of one vehicle, over the reading's range [-]: 67
recorded trips of a petrol car had -0.03 to 0.025 in 19 of 20 pairs."""

TELLING: Final = 0.04
"""A scale whose own standard deviation is larger shows nothing [-]."""

UNKNOWN_PRESSURE: Final = 0.10
"""By how much pressures may differ where one is not known [-]: 700 m of height and weather."""

UNKNOWN_TEMPERATURE: Final = 0.10
"""By how much temperatures may differ where one is not known [-]: 30 K."""

LATER: Final = 0.5
"""A reading later or earlier against its second signal by so much is moved [s]; what its lateness
does to the mass is judged against the motion."""

Verdict = Literal["agrees", "doubtful", "serious"]
_ORDER: Final[tuple[Verdict, ...]] = ("agrees", "doubtful", "serious")


@dataclass(frozen=True, slots=True)
class Finding:
    """What one second signal says of the reading in a drive.

    Attributes
    ----------
    signal : of the second signal
    verdict
    scale : reading over what the second signal shows [-]
    offset : reading less what it shows, over the reading's range [-]
    scaled : whether it is the scale that is off, not the level
    """

    signal: str
    verdict: Verdict
    scale: float
    offset: float
    scaled: bool = True

    @property
    def sign(self) -> int:
        """1 where the reading is too high, -1 where it is too low."""
        return 1 if (self.scale > 1.0 if self.scaled else self.offset > 0.0) else -1


def findings(drive: Drive, vehicle: Vehicle) -> tuple[Finding, ...]:
    """What each second signal of a vehicle file that can judge says of a drive's torque reading."""
    found = (_finding(drive, vehicle, relation) for relation in vehicle.witnesses)
    return tuple(f for f in found if f is not None)


def _finding(drive: Drive, vehicle: Vehicle, relation: SecondSignalRelation) -> Finding | None:
    second_signal = BY_SIGNAL[relation.signal]
    rows = rows_of(drive, vehicle, second_signal)
    if rows is None:
        return None
    lag = lateness(rows, second_signal, relation)
    if lag is not None and math.isnan(lag):
        return None  # It is on another clock, further away than was tried.
    if lag is not None and abs(later := lag - (relation.lag or 0.0)) >= LATER:
        rows = rows_of(drive, vehicle, second_signal, later) or rows
    found = means(rows, second_signal, ranges_of(relation))
    if found.time.size < SOME:
        return None
    air = air_of(drive, float(found.time[0]), float(found.time[-1]))
    return judged(found, relation, accepted_scales(vehicle.torque.of_source.name, relation, air))


def judged(
    rows: Means, relation: SecondSignalRelation, accepted: tuple[float, float]
) -> Finding | None:
    """Judge a drive by the relation.

    Parameters
    ----------
    rows : means over windows
    relation
    accepted : scales that the air explains [-]

    Returns
    -------
    Finding
        None where the reading is not off and the drive cannot show that it is right either.
    """
    found = compare(rows.reading, predicted_by(relation, rows))
    if found.scale <= 0.0:
        return None  # The two have nothing to do with each other.
    second_signal = BY_SIGNAL[relation.signal]
    low, high = accepted
    scale_off = max(low - found.scale, found.scale - high, 0.0)
    predicted = sorted((low * found.predicted, high * found.predicted))
    level_off = max(predicted[0] - found.level, found.level - predicted[1], 0.0) / relation.span
    if second_signal.battery:
        level_off = 0.0  # Heating and cooling come and go.
    by_scale = _verdict(scale_off, float(np.hypot(found.scale_std, relation.scale_std)))
    by_level = _verdict(level_off, float(np.hypot(found.level_std / relation.span, LEVEL_STD)))
    finding = Finding(
        relation.signal,
        max(by_scale, by_level, key=_ORDER.index),
        found.scale,
        (found.level - found.predicted) / relation.span,
        scaled=_ORDER.index(by_scale) >= _ORDER.index(by_level),
    )
    if finding.verdict == "agrees" and found.scale_std > TELLING:
        return None
    # Of what a battery gives, heating takes a part that may change on the way.
    harmless = second_signal.battery or (second_signal.enriched and finding.sign < 0)
    return (
        replace(finding, verdict="doubtful")
        if finding.verdict == "serious" and harmless
        else finding
    )


def _verdict(off: float, std: float) -> Verdict:
    if off > max(SERIOUS, SURE * std):
        return "serious"
    return "doubtful" if off > max(QUESTIONABLE, POSSIBLE * std) else "agrees"


def accepted_scales(
    source: str, relation: SecondSignalRelation, air: tuple[float, float]
) -> tuple[float, float]:
    """Scales of reading over second signal that the air explains: lowest and highest [-].

    Parameters
    ----------
    source : of the torque
    relation : with the air of the calibration
    air : pressure [Pa] and temperature [K] of the drive; NaN where unknown
    """
    mine = LOAD_AIR if source == "load" else ((0.0, 0.0), (0.0, 0.0))
    theirs = BY_SIGNAL[relation.signal].air
    before = (relation.pressure, relation.temperature)
    low = high = 0.0
    reach = (UNKNOWN_PRESSURE, UNKNOWN_TEMPERATURE)
    for own, other, known, there, far in zip(mine, theirs, air, before, reach, strict=True):
        powers = (own[0] - other[1], own[1] - other[0])
        sizes: tuple[float, ...] = (-far, far)
        if there is not None and np.isfinite(known):
            sizes = (float(np.log(known / there)),)
        effects = [p * size for p in (*powers, 0.0) for size in sizes]
        low, high = low + min(effects), high + max(effects)
    return float(np.exp(low)), float(np.exp(high))


def difference(finding: Finding) -> str:
    """How the reading differs from what the second signal shows, in words."""
    if finding.scaled:
        return phrase("as_much", scale=finding.scale)
    which = "range_more" if finding.sign > 0 else "range_less"
    return phrase(which, share=100.0 * abs(finding.offset))
