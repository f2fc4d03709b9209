"""Does the torque's reading still go with its second signals as in the calibration?"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np

from weighbridge.balance.second_signal import (
    BY_SIGNAL,
    DELAYS,
    FEWEST_MEANS,
    LOAD_AIR,
    Comparison,
    Following,
    Line,
    Means,
    air_of,
    compare,
    follow,
    line_of,
    means,
    predicted_by,
    ranges_of,
    rows_of,
)
from weighbridge.messages import phrase
from weighbridge.signals import Drive
from weighbridge.vehicle.model import SecondSignalRelation, Vehicle

QUESTIONABLE: Final = 0.05
"""Scale, or level over the reading's range, off by more is questioned [-]."""

SERIOUS: Final = 0.09
"""The same, above which there is no mass [-]: the mass is off by 1.1 to 1.5 times as much."""

QUESTION_SURE: Final = 2.0
SURE: Final = 3.5
"""Standard deviations by which it has to be off for the one and for the other [-]. With these, 8 of
1184 pairs of calibration and drive of recorded vehicles were questioned (a petrol car's load by
intake pressure, another's torque by it, an electric car by its battery), and 2 refused beside those
with a trip whose torque repeats one value to its end."""

LEVEL_STD: Final = 0.02
"""Standard deviation of the level between drives of one vehicle, over the reading's range [-]: 67
recorded trips of a petrol car had -0.03 to 0.025 in 19 of 20 pairs."""

CHANGE: Final = 0.04
"""As `QUESTIONABLE`, between two parts of a drive, in which what differs between drives is the same
[-]."""

CHANGED: Final = 5.0
"""Two parts of a drive differ surely from so many standard deviations on [-]."""

PARTS: Final = 10
"""Instants at which a drive is split, less one."""

TELLING: Final = 0.04
"""A scale whose own standard deviation is larger shows nothing [-]."""

UNKNOWN_PRESSURE: Final = 0.10
"""By how much pressures may differ where one is not known [-]: 700 m of height and weather."""

UNKNOWN_TEMPERATURE: Final = 0.10
"""By how much temperatures may differ where one is not known [-]: 30 K."""

UNKNOWN_CHANGE: Final = 0.03
"""By how much pressure and temperature may differ between two parts of a drive that has them not
[-]: 250 m of height, 9 K."""

BLURRED: Final = 0.7
"""A reading is smoother than in the calibration from this time constant on [s]: simulated masses
were 5 to 9 % light at 1 s, 16 to 45 % at 3 s."""

UNBLURRED: Final = 0.75
"""The variance left is less than this part of that with the calibration's blur [-]."""

CLEARLY: Final = 0.35
"""The same, below which noise cannot be the reason [-]: 0.36 to 0.42 in simulated drives whose
reading was smoothed by 1 s, 0.03 to 0.34 in recorded ones; 0.46 to 0.67 where a fifth of the
engine speeds was missing."""

NOISIER: Final = 1.4
"""Variance that a blur leaves unexplained, over that of the calibration, at most [-]: 0.9 to 1 for
smoothed readings of simulated drives, 1.6 to 3 for an engine speed with dropouts."""

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
    start, end : of the part that is off [s]; infinite for the ends of the drive
    before : the part is off against the one before it, not against the calibration
    blur : time constant by which the reading is smoother than the second signal [s]; 0 if not so
    """

    signal: str
    verdict: Verdict
    scale: float
    offset: float
    scaled: bool = True
    start: float = -np.inf
    end: float = np.inf
    before: bool = False
    blur: float = 0.0

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
    following = follow(rows, second_signal, relation)
    if following is not None and _smoothed(following, relation):
        return Finding(relation.signal, "serious", 1.0, 0.0, blur=following.blur)
    if following is not None and following.lag in (DELAYS[0], DELAYS[-1]):
        return None  # It is on another clock, further away than was tried.
    if following is not None and abs(later := following.lag - (relation.lag or 0.0)) >= LATER:
        rows = rows_of(drive, vehicle, second_signal, later) or rows
    every = means(rows, second_signal, ranges_of(relation))
    if every.time.size < FEWEST_MEANS:
        return None
    source, many = vehicle.torque.of_source.name, every.time.size

    def of(first: int, last: int) -> Finding | None:
        part = _part(every, first, last)
        air = air_of(drive, float(part.time[0]), float(part.time[-1]))
        start = float(part.time[0]) if first > 0 else -np.inf
        end = float(part.time[-1]) if last < many else np.inf
        accepted = accepted_scales(source, relation, air)
        return judged(part, relation, accepted, (start, end))

    whole = of(0, many)
    cut = _change(every, relation)
    if cut is None:
        return whole
    halves = [f for f in (of(0, cut), of(cut, many)) if f is not None]
    bad = [f for f in halves if f.verdict != "agrees"]
    if len(bad) == 2 and whole is not None and whole.verdict != "agrees":
        return whole
    if bad:
        return max(bad, key=lambda f: f.verdict == "serious")
    changed = _against_before(drive, source, relation, every, cut)
    if changed.verdict != "agrees" and (whole is None or whole.verdict != "serious"):
        return changed
    return whole


def _part(every: Means, first: int, last: int) -> Means:
    return Means(every.time[first:last], every.reading[first:last], every.terms[first:last])


def _against_before(
    drive: Drive, source: str, relation: SecondSignalRelation, every: Means, cut: int
) -> Finding:
    """Judge the second part of a drive by how reading and second signal went in the first."""
    first, second = _part(every, 0, cut), _part(every, cut, every.time.size)
    air = air_of(drive, float(first.time[0]), float(first.time[-1]))
    later = air_of(drive, float(second.time[0]), float(second.time[-1]))
    a = compare(first.reading, predicted_by(relation, first))
    b = compare(second.reading, a.level + a.scale * (predicted_by(relation, second) - a.predicted))
    pressure, temperature = (x if np.isfinite(x) else None for x in air)
    before = replace(relation, pressure=pressure, temperature=temperature)
    accepted = accepted_scales(source, before, later, unknown=UNKNOWN_CHANGE)
    return _judged(
        b,
        relation,
        accepted,
        (float(np.hypot(a.scale_std, b.scale_std)), float(np.hypot(a.level_std, b.level_std))),
        Finding(relation.signal, "agrees", 1.0, 0.0, start=float(second.time[0]), before=True),
        questionable=CHANGE,
    )


def _smoothed(found: Following, relation: SecondSignalRelation) -> bool:
    """Say whether a reading is smoother than in the calibration.

    A noisy second signal, smoothed, goes better with the reading as well, but not as well as it
    did.
    """
    if relation.blur is None or relation.unexplained is None:
        return False
    if found.blur - relation.blur < BLURRED:
        return False
    better = found.left / max(found.usual_left, 1e-12)
    as_before = found.left < NOISIER * relation.unexplained
    return better < CLEARLY or (better < UNBLURRED and as_before)


def judged(
    part: Means,
    relation: SecondSignalRelation,
    accepted: tuple[float, float],
    when: tuple[float, float] = (-np.inf, np.inf),
) -> Finding | None:
    """Judge a part of a drive by the relation.

    Parameters
    ----------
    part : means over windows
    relation
    accepted : scales that the air explains [-]
    when : start and end of the part, for the finding [s]

    Returns
    -------
    Finding
        None where the part is not off and cannot show that it is right either.
    """
    found = compare(part.reading, predicted_by(relation, part))
    if found.scale <= 0.0:
        return None  # The two have nothing to do with each other.
    stds = (
        float(np.hypot(found.scale_std, relation.scale_std)),
        float(np.hypot(found.level_std, LEVEL_STD * relation.span)),
    )
    start, end = when
    finding = Finding(relation.signal, "agrees", 1.0, 0.0, start=start, end=end)
    finding = _judged(found, relation, accepted, stds, finding)
    if finding.verdict == "agrees" and found.scale_std > TELLING:
        return None
    return finding


def _judged(
    found: Comparison,
    relation: SecondSignalRelation,
    accepted: tuple[float, float],
    stds: tuple[float, float],
    finding: Finding,
    *,
    questionable: float = QUESTIONABLE,
) -> Finding:
    """Complete a finding by what was found.

    Parameters
    ----------
    found, relation
    accepted : scales that the air explains [-]
    stds : of scale [-] and level [unit of the reading]
    finding : with the part of the drive it is of
    questionable : limit of what is questioned [-]
    """
    second_signal = BY_SIGNAL[relation.signal]
    low, high = accepted
    scale_off = max(low - found.scale, found.scale - high, 0.0)
    predicted = sorted((low * found.predicted, high * found.predicted))
    level_off = max(predicted[0] - found.level, found.level - predicted[1], 0.0) / relation.span
    if second_signal.battery:
        level_off = 0.0  # Heating and cooling come and go.
    by_scale = _verdict(scale_off, stds[0], questionable)
    by_level = _verdict(level_off, stds[1] / relation.span, questionable)
    verdict = max(by_scale, by_level, key=_ORDER.index)
    finding = replace(
        finding,
        scale=found.scale,
        offset=(found.level - found.predicted) / relation.span,
        scaled=_ORDER.index(by_scale) >= _ORDER.index(by_level),
    )
    # Of what a battery gives, heating takes a part that may change on the way.
    if verdict == "serious" and (
        second_signal.battery or (second_signal.enriched and finding.sign < 0)
    ):
        verdict = "doubtful"
    return replace(finding, verdict=verdict)


def _verdict(off: float, std: float, questionable: float) -> Verdict:
    if off > max(SERIOUS, SURE * std):
        return "serious"
    return "doubtful" if off > max(questionable, QUESTION_SURE * std) else "agrees"


def _change(every: Means, relation: SecondSignalRelation) -> int | None:
    """Find where reading and second signal begin to go otherwise: first row of the second part."""
    predicted = predicted_by(relation, every)
    best, at = 0.0, None
    for k in range(1, PARTS):
        cut = every.time.size * k // PARTS
        if min(cut, every.time.size - cut) < FEWEST_MEANS:
            continue
        first = every.reading[:cut], predicted[:cut]
        second = every.reading[cut:], predicted[cut:]
        # How sure a difference is takes most of the time, and matters to those that are large.
        if max(_offs(line_of(*first), line_of(*second), relation)) <= CHANGE:
            continue
        gain = _apart(compare(*first), compare(*second), relation)
        if gain > best:
            best, at = gain, cut
    return at


def _offs(a: Line, b: Line, relation: SecondSignalRelation) -> tuple[float, float]:
    """By how much scale and level of two parts differ [-]."""
    level = abs((a.level - a.predicted) - (b.level - b.predicted)) / relation.span
    return abs(a.scale - b.scale), level


def _apart(a: Comparison, b: Comparison, relation: SecondSignalRelation) -> float:
    """By how many standard deviations two parts differ surely [-]; 0 where they do not."""
    scale, level = _offs(a, b, relation)
    scale_std = float(np.hypot(a.scale_std, b.scale_std))
    level_std = float(np.hypot(a.level_std, b.level_std)) / relation.span
    found = [
        off / max(std, 1e-9)
        for off, std in ((scale, scale_std), (level, level_std))
        if off > CHANGE and off > CHANGED * std
    ]
    return max(found, default=0.0)


def accepted_scales(
    source: str,
    relation: SecondSignalRelation,
    air: tuple[float, float],
    unknown: float | None = None,
) -> tuple[float, float]:
    """Scales of reading over second signal that the air explains: lowest and highest [-].

    Parameters
    ----------
    source : of the torque
    relation : with the air of the calibration
    air : pressure [Pa] and temperature [K] of the drive; NaN where unknown
    unknown : by how much an unknown pressure or temperature may differ [-]; None for what two
        drives may differ by
    """
    mine = LOAD_AIR if source == "load" else ((0.0, 0.0), (0.0, 0.0))
    theirs = BY_SIGNAL[relation.signal].air
    before = (relation.pressure, relation.temperature)
    low = high = 0.0
    reach = (unknown,) * 2 if unknown is not None else (UNKNOWN_PRESSURE, UNKNOWN_TEMPERATURE)
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
