"""The answer of a page: what it weighs, how sure that is, and what would make it surer."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING, Final

from weighbridge.estimators import Status
from weighbridge.navigation import BY_SPEED
from weighbridge.report.style import REACH
from weighbridge.report.text import (
    between,
    capital,
    kg,
    pounds,
    prose,
    sentence,
    signed_kg,
    with_half,
)
from weighbridge.vehicle import by_data_sheet, scale_std
from weighbridge.vehicle.description import can_weigh

if TYPE_CHECKING:
    from weighbridge.results.weighing import MassResult
    from weighbridge.vehicle import Vehicle

GRADES: Final = ((0.02, "fine"), (0.05, "good"), (0.10, "fair"), (math.inf, "rough"))
"""Half of the 95 % interval over the mass, up to which an answer is called so [-]."""

FEW_DRIVES: Final = 2
"""Calibration drives below which more of them help most."""

STATUS_TEXT: Final[dict[Status, str]] = {
    Status.CONVERGED: "converged",
    Status.NOT_EXCITED: "no mass: the drive says too little",
    Status.INCONSISTENT: "no mass: the data contradict each other",
    Status.MISSING_SIGNALS: "no mass: signals are missing",
}

REMEDY_TEXT: Final[dict[Status, str]] = {
    Status.CONVERGED: "",
    Status.NOT_EXCITED: "A mass shows only while the vehicle speeds up or climbs under its own "
    "power. A longer drive with more starts, firm accelerations and hills would help; the "
    "excluded samples below show where this one was lost.",
    Status.INCONSISTENT: "Force and motion do not fit one mass. Check the units of speed and "
    "torque, the gear ratios and wheel radius of the vehicle file, and whether the file belongs "
    "to this vehicle.",
    Status.MISSING_SIGNALS: "Record the missing signals, or use a vehicle file whose torque source "
    "the drive has; weighbridge inspect lists what is there and what it allows.",
}

SPEED_REMEDY_TEXT: Final[dict[Status, str]] = {
    Status.CONVERGED: "",
    Status.NOT_EXCITED: "No drive helps, however long or hilly: with torque in proportion to "
    "speed, force and mass drop out together, and the mass of the calibration comes back. "
    "Record torque or engine load beside the speed, calibrate and weigh with method joint.",
    Status.INCONSISTENT: "The speeds of this drive are not like those of the calibration. Check "
    "the unit of the speed and whether the vehicle file belongs to this vehicle; for a mass, "
    "record torque or engine load.",
    Status.MISSING_SIGNALS: "Record the speed of the vehicle or of GNSS; weighbridge inspect lists "
    "what is there and what it allows.",
}
"""The same where speed alone was weighed by."""


CALIBRATE_TEXT: Final = (
    "Calibrate the vehicle on a drive with a mass from a scale (weighbridge calibrate)."
)
SPEED_CALIBRATE_TEXT: Final = (
    "Calibrate the vehicle for this method on a drive with a mass from a scale "
    "(weighbridge calibrate --method speed-ekf)."
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Answer:
    """What the first block of a page says; all intervals hold 95 %.

    Attributes
    ----------
    mass : [kg]
    interval : of the mass [kg]
    most : mass that is not exceeded, with a probability of 95 % [kg]
    tare, gross : empty and permitted mass of the vehicle file [kg]; None where unknown
    payload : interval of the payload [kg]; NaN where there is no tare
    file : what the vehicle file is worth, a sentence
    advice : what would make the answer better, sentences
    judged : how it compares with a known mass and with other methods, sentences
    """

    mass: float
    interval: tuple[float, float]
    most: float
    tare: float | None
    gross: float | None
    payload: tuple[float, float]
    file: str
    advice: str
    judged: tuple[str, ...] = ()

    @property
    def half(self) -> float:
        """Half of the interval [kg]."""
        return 0.5 * (self.interval[1] - self.interval[0])


def grade(mass: float, half: float) -> str:
    """Name how sure a mass is, see `GRADES`.

    Parameters
    ----------
    mass : [kg]
    half : half of its 95 % interval [kg]
    """
    relative = half / mass if mass > 0.0 else math.inf
    return next((name for most, name in GRADES if relative <= most), GRADES[-1][1])


def answer_block(answer: Answer) -> str:
    """Return the block as HTML."""
    low, high = answer.interval
    sure = math.isfinite(answer.half)
    named = grade(answer.mass, answer.half if sure else math.inf)
    reported = (
        f"{named}: ± {_percent(answer.half / answer.mass)}" if sure else "rough: no upper bound"
    )
    holds = f"95 % interval {between(low, high)}" if sure else "no interval"
    judged = "".join(f'<p class="why">{prose(text)}</p>' for text in answer.judged)
    alert = _alert(answer)
    over = " over" if alert else ""
    return (
        f'<div class="verdict {named}{over}">{alert}'
        f'<p class="answer {named}">{with_half(answer.mass, answer.half)} '
        f'<span class="grade">{reported}</span></p><p class="holds">{holds}</p>{judged}'
        f'<dl class="key">{_payload(answer)}{_share(answer)}'
        f"{_item('vehicle file', answer.file)}{_item('for a better answer', answer.advice)}"
        "</dl></div>"
    )


def no_answer_block(status: Status, reason: str, remedy: str) -> str:
    """Return the block of a drive that carries no mass, as HTML."""
    reported = f'<p class="why">{prose(sentence(reason))}</p>' if reason else ""
    helps = (
        f'<dl class="key">{_item("what would help", remedy)}</dl>' if remedy else ""
    )  # fmt: skip
    return (
        '<div class="verdict none">'
        f'<p class="answer bad">{escape(capital(STATUS_TEXT[status]))}</p>'
        f"{reported}{helps}</div>"
    )


def weighing_answer(weighing: MassResult, judged: tuple[str, ...]) -> str:
    """Return the block of a weighing as HTML; ``judged`` holds it against other masses."""
    if weighing.status is not Status.CONVERGED or not math.isfinite(weighing.mass):
        return no_answer_block(weighing.status, shown_reason(weighing), remedy(weighing))
    low, high = weighing.interval(0.95)
    tare = weighing.vehicle.tare
    empty = math.nan if tare is None else tare
    return answer_block(
        Answer(
            mass=weighing.mass,
            interval=(low, high),
            most=weighing.interval(0.9)[1],
            tare=tare,
            gross=weighing.vehicle.gross,
            payload=(low - empty, high - empty),
            file=file_worth(weighing.seen),
            advice=advice(weighing),
            judged=judged,
        )
    )


def shown_reason(weighing: MassResult) -> str:
    """Say why there is no mass, in the units that are shown."""
    return "" if weighing.refusal is None else weighing.refusal.shown


def overloaded(weighing: MassResult) -> bool:
    """Say whether the mass is above the permitted one of the vehicle file."""
    gross = weighing.vehicle.gross
    return gross is not None and weighing.mass > gross


def remedy(weighing: MassResult) -> str:
    """Say what would let a drive without a mass carry one."""
    speed_alone = weighing.estimator.speed_alone
    if weighing.status is Status.MISSING_SIGNALS:
        if speed_alone and weighing.vehicle.speed_model is None:
            return SPEED_CALIBRATE_TEXT
        if not speed_alone and not can_weigh(weighing.vehicle):
            return CALIBRATE_TEXT
    texts = SPEED_REMEDY_TEXT if speed_alone else REMEDY_TEXT
    return texts[weighing.status]


def file_worth(vehicle: Vehicle) -> str:
    """Say what a vehicle file leaves uncertain of any mass, as a 95 % interval."""
    made = vehicle.provenance
    if not can_weigh(vehicle):
        return "Not calibrated: it does not say what the torque is worth."
    if made.mass_scale_std is None:
        by = "From a data sheet" if by_data_sheet(vehicle) else "Not calibrated"
        return f"{by}: it leaves ± {_percent(REACH * scale_std(vehicle))} or more."
    left = f"± {_percent(REACH * made.mass_scale_std)} or more"
    drives = max(len(made.drives), len(made.masses))
    if not drives:
        return f"Never calibrated: it states {left}."
    on = "one drive" if drives == 1 else f"{drives} drives"
    return f"Calibrated on {on} of known mass: it leaves {left}."


def advice(weighing: MassResult) -> str:
    """Say what would make a mass surer: the vehicle file, the sensors, or the drive."""
    result = weighing.result
    assert result is not None
    if weighing.estimator.speed_alone:
        return "Record torque or engine load beside the speed: speed alone hardly shows the load."
    low, high = weighing.interval(0.95)
    half = 0.5 * (high - low)
    if grade(weighing.mass, half) == "fine":
        return "Nothing is needed: the mass is known to within 2 %."
    left = _left_by_file(weighing)
    own = math.sqrt(max(weighing.std**2 - left**2, 0.0))
    reach = half / weighing.std if weighing.std > 0.0 else REACH
    if own > left:
        return (
            "Drive longer, with more firm starts and hills: the drive leaves "
            f"± {pounds(reach * own):.0f} of the ± {kg(half)}."
        )
    if result.balance.motion.source in BY_SPEED:
        helps = "Record an accelerometer beside the speed."
    else:
        helps = _calibrate(weighing.vehicle)
    return (
        f"{helps} Vehicle file and sensors leave ± {pounds(reach * left):.0f} of the ± {kg(half)}; "
        "more driving takes none of that away."
    )


def _left_by_file(weighing: MassResult) -> float:
    """Standard deviation that no longer drive takes away [kg]."""
    result = weighing.result
    assert result is not None
    if math.isfinite(result.systematic_std):
        return min(result.systematic_std, weighing.std)
    made = weighing.seen.provenance
    scale = made.mass_scale_std if made.mass_scale_std is not None else scale_std(weighing.seen)
    return min(scale * weighing.mass, weighing.std)


def _calibrate(vehicle: Vehicle) -> str:
    made = vehicle.provenance
    drives = max(len(made.drives), len(made.masses))
    if made.doubts:
        return "Calibrate again: the notes list what is uncertain in the calibration."
    if not drives:
        return CALIBRATE_TEXT
    if drives <= FEW_DRIVES:
        return "Calibrate on more drives, of other known masses."
    return "Calibrate on drives like this one: same place of the sensor, like roads and load."


def _payload(answer: Answer) -> str:
    if answer.tare is None:
        return _item("payload", "Unknown without a tare: add tare_kg to the vehicle file.")
    low, high = answer.payload
    half = f" ± {pounds(0.5 * (high - low)):.0f}" if math.isfinite(high - low) else ""
    value, _, unit = signed_kg(answer.mass - answer.tare).partition(" ")
    return _item("payload", f"over a tare of {kg(answer.tare)}", f"{value}{half} {unit}")


def _alert(answer: Answer) -> str:
    """Say at the top that the vehicle is overloaded; nothing where it is not."""
    if not answer.gross or answer.mass <= answer.gross:
        return ""
    sure = "Overload" if answer.interval[0] > answer.gross else "Overload is likely"
    over = answer.mass - answer.gross
    return f'<p class="alert bad">{sure}: {kg(over)} above the permitted {kg(answer.gross)}.</p>'


def _room(answer: Answer) -> str:
    """Payload that may be added [kg], in words; nothing where there is no room for sure."""
    room = (answer.gross or 0.0) - answer.most
    return f"; room left: {kg(room)}, 95 % sure" if room > 0.0 else ""


def _share(answer: Answer) -> str:
    """Part of the permitted mass, as text and as a bar."""
    if not answer.gross:
        return _item("of the permitted mass", "Unknown: add gross_kg to the vehicle file.")
    share = answer.mass / answer.gross
    low, high = (
        (x / answer.gross if math.isfinite(x) else math.inf) for x in answer.interval
    )  # fmt: skip
    verdict = "within it"
    if low > 1.0:
        verdict = "above it"
    elif high > 1.0:
        verdict = "perhaps above it" if share <= 1.0 else "likely above it"
    full = max(1.2, 1.05 * share)
    left, width = (100.0 * min(max(x, 0.0), full) / full for x in (low, min(high, full) - low))
    bar = (
        f'<span class="bar {"over" if share > 1.0 else ""}" aria-hidden="true">'
        f'<i style="left:{left:.1f}%;width:{width:.1f}%"></i>'
        f'<b style="left:{100.0 * share / full:.1f}%"></b><u style="left:{100.0 / full:.1f}%"></u>'
        "</span>"
    )
    reach = f"{100.0 * low:.0f} to {100.0 * high:.0f} %"
    if not math.isfinite(high):
        reach = f"{100.0 * low:.0f} % or more"
    text = f"of {kg(answer.gross)}, {verdict}: {reach}{_room(answer)}"
    return _item("of the permitted mass", text, f"{100.0 * share:.0f} %", bar)


def _item(name: str, text: str, value: str = "", more: str = "") -> str:
    strong = f"<strong>{escape(value)}</strong> " if value else ""
    # A line never breaks between a number and its sign or unit.
    text = re.sub(r"(?<=\d) (?=(?:%|kg|lb)\b|%)|(?<=±) ", "\u00a0", text)
    return f"<div><dt>{name}</dt><dd>{strong}{prose(text)}{more}</dd></div>"


def _percent(share: float) -> str:
    return f"{100.0 * share:.0f} %" if share >= 0.0995 else f"{100.0 * share:.1f} %"
