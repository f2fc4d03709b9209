"""A weighing in words, for a person."""

from __future__ import annotations

import math

from weighbridge.live.weighing import LiveWeighing, SignalHealth
from weighbridge.report.text import NOTHING, kg, with_half
from weighbridge.signals.catalogue import IMU_SIGNALS


def half_width(weighing: LiveWeighing) -> float:
    """Half of the interval of 95 % [kg]; NaN or infinite where there is none."""
    low, high = weighing.interval()
    return 0.5 * (high - low)


def mass_text(weighing: LiveWeighing) -> str:
    """Write the mass with half the width of its interval of 95 %."""
    return with_half(weighing.mass, half_width(weighing))


def reason_text(weighing: LiveWeighing) -> str:
    """Write why there is no mass that counts; empty where there is."""
    return "" if weighing.refusal is None else weighing.refusal.shown


def payload_text(weighing: LiveWeighing) -> str:
    """Write the payload."""
    name = "payload" if weighing.tared is None else "payload since the tare"
    return f"{name} {kg(weighing.payload)}"


def overload_text(weighing: LiveWeighing) -> str:
    """Write the probability that the permitted mass is exceeded, or why there is none.

    Without a permitted mass a limit of ``--above`` takes its place. Empty where there is no mass
    yet.
    """
    if not math.isfinite(weighing.mass):
        return ""
    if weighing.gross is not None:
        p = weighing.overload
        return "" if p is None else f"overload probability {_percent(p)}"
    for alert in weighing.alerts:
        if alert.side == "above" and alert.probability is not None:
            return f"above {kg(alert.limit)} with probability {_percent(alert.probability)}"
    return "no permitted mass in the vehicle file"


def _percent(p: float) -> str:
    if 0.0 < p < 0.01:
        return "less than 1 %"
    if 0.99 < p < 1.0:
        return "more than 99 %"
    return f"{100.0 * p:.0f} %"


def remaining_text(minutes: float, percent: int, reach: float) -> str:
    """Write how long until the interval is within so many percent.

    Parameters
    ----------
    minutes, percent
    reach : see `weighbridge.live.weighing.LiveWeighing`
    """
    if math.isnan(minutes):
        return f"± {percent} %: not known yet"
    if minutes == 0.0:
        return f"± {percent} %: reached"
    if math.isinf(minutes):
        return f"± {percent} %: {_never(reach)}"
    more = f"{minutes:.0f} min" if minutes >= 1.0 else "less than 1 min"
    return f"± {percent} %: {more} more"


def _never(reach: float) -> str:
    """Say what stays open; rounded up, or it would look as if it did."""
    if math.isnan(reach):
        return "not by driving on"
    left = math.ceil(1000.0 * reach) / 10.0
    return f"not by driving on, vehicle file and sensors leave ± {left:.1f} %"


def needed_text(weighing: LiveWeighing) -> str:
    """Write what is needed until 5 % and 2 %."""
    two = remaining_text(weighing.minutes_to_2, 2, weighing.reach)
    five = remaining_text(weighing.minutes_to_5, 5, weighing.reach)
    if math.isinf(weighing.minutes_to_5):
        return f"± 5 %, {two}"
    reached = weighing.minutes_to_2 == 0.0
    same = math.isnan(weighing.minutes_to_5) and math.isnan(weighing.minutes_to_2)
    return two if reached else "time left not known yet" if same else f"{five}, {two}"


def rate_text(signal: SignalHealth) -> str:
    """Write the rate of a signal, or its period where it comes each 10 s or more seldom."""
    if signal.rate == 0.0:
        return NOTHING
    if signal.rate <= 0.1:
        return f"1/{1.0 / signal.rate:.0f} s"
    return f"{signal.rate:.1f} Hz" if signal.rate < 1000.0 else f"{signal.rate:.0f} Hz"


def age_text(signal: SignalHealth) -> str:
    """Write the age of a signal's newest sample."""
    if not math.isfinite(signal.age):
        return NOTHING
    if signal.age < 99.95:
        return f"{max(signal.age, 0.0):.1f} s"
    return f"{signal.age / 60.0:.0f} min" if signal.age < 6000.0 else f"{signal.age / 3600.0:.0f} h"


def state_text(signal: SignalHealth) -> str:
    """Write how a signal does, in one word."""
    if signal.fresh:
        return "ok"
    if signal.rests:
        return "rests"
    return "silent" if math.isfinite(signal.age) else "absent"


def progress_text(weighing: LiveWeighing) -> tuple[str, float]:
    """Write which interval is on its way, and the part of the way to it [-]; 0 where unknown."""
    if weighing.progress_to_5 >= 1.0:
        return "± 2 %", weighing.progress
    return "± 5 %", 0.0 if math.isnan(weighing.progress_to_5) else weighing.progress_to_5


def signals_text(weighing: LiveWeighing) -> str:
    """Write how many signals come, and which do not, needed ones first."""
    if not weighing.signals:
        return "no signal yet"
    come = sum(s.fresh for s in weighing.signals)
    wrong = sorted((s for s in weighing.signals if s.fails), key=lambda s: not s.needed)
    text = f"{come} of {len(weighing.signals)} signals come"
    return f"{text}; not: {', '.join(s.name for s in wrong)}" if wrong else text


def rates_text(weighing: LiveWeighing) -> str:
    """Write how often the signals come that a weighing needs; empty where none does."""
    come = [s for s in weighing.signals if s.needed and s.fresh]
    inertial = [s for s in come if s.name in IMU_SIGNALS]
    found = [f"{s.name} {rate_text(s)}" for s in come if s not in inertial]
    if inertial:
        found.append(f"inertial sensor {rate_text(min(inertial, key=lambda s: s.rate))}")
    return ", ".join(found)


def alerts_text(weighing: LiveWeighing) -> str:
    """Write the alerts that are active; empty where none is."""
    found = []
    for alert in weighing.alerts:
        if alert.active:
            overload = alert.side == "above" and alert.limit == weighing.gross
            sure = "" if alert.probability is None else f", {_percent(alert.probability)} sure"
            found.append(
                f"{'Overload' if overload else 'Alert'}: {alert.side} {kg(alert.limit)}{sure}"
            )
    return "; ".join(found)
