"""A weighing on the terminal: a view that changes in place, or plain lines where nobody looks."""

from __future__ import annotations

import logging
import math
import sys
import time
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Final, TextIO

from weighbridge.live.outputs.thinning import due, news
from weighbridge.live.weighing import LiveStatus, LiveWeighing, SignalHealth
from weighbridge.report.text import NOTHING, between, capital, duration, kg, with_half
from weighbridge.signals.catalogue import IMU_SIGNALS
from weighbridge.visible import cut, visible

if TYPE_CHECKING:
    from rich.console import Console, ConsoleOptions
    from rich.text import Text


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


_STATUS_STYLE: Final = {
    LiveStatus.LEARNING: "bold black on yellow",
    LiveStatus.WEIGHED: "bold black on green",
    LiveStatus.INCONSISTENT: "bold white on red",
}

# Probabilities of an overload from which the bar is yellow and red [-].
_QUESTIONABLE: Final = 0.05
_LIKELY: Final = 0.5

# The view is drawn anew at most so often [s].
_PERIOD: Final = 0.2

# Lines that the newest view leaves free at the end: the mass, what was written, the prompt.
_AFTER: Final = 5

# From this width on, two signals are in one line.
_WIDE: Final = 78
_LONGEST_NAME: Final = 26

_LINE_PERIOD: Final = 60.0
"""A plain line comes at least so often, on the clock of the samples [s],"""

_EARLY_PERIOD: Final = 10.0
"""and before the first mass so often [s]."""


class TerminalView:
    """Shows the newest weighing in place, as high and wide as the terminal has room.

    Parameters
    ----------
    console : of the terminal, for standard error
    clock : gives the time [s], for how often the view is drawn
    """

    name = "terminal"

    def __init__(self, console: Console, clock: Callable[[], float] = time.monotonic) -> None:
        from rich.live import Live

        self._clock = clock
        self._drawn = -_PERIOD
        self._newest: LiveWeighing | None = None
        # Standard output is for results.
        self._live = Live(
            console=console, auto_refresh=False, redirect_stdout=False, redirect_stderr=True
        )
        self._live.start()
        self._moved = _through(sys.stderr)

    def show(self, weighing: LiveWeighing) -> None:
        """Draw a weighing, unless the last one was drawn a moment ago."""
        self._newest = weighing
        now = self._clock()
        if now - self._drawn >= _PERIOD:
            self._drawn = now
            self._live.update(View(weighing), refresh=True)

    def close(self) -> None:
        """Leave the newest view on the terminal."""
        if self._newest is not None:
            self._live.update(View(self._newest, spare=_AFTER), refresh=True)
        self._live.stop()
        for handler, stream in self._moved:
            handler.setStream(stream)


class PlainLines:
    """Prints a line a minute, each 10 s before the first mass, and one for all that changes.

    A change is one of the status, of an alert, and that the vehicle is parked or no longer.

    Parameters
    ----------
    console : for standard error
    """

    name = "standard error"

    def __init__(self, console: Console) -> None:
        self._console = console
        self._news: object = None
        self._reported = float("nan")

    def show(self, weighing: LiveWeighing) -> None:
        """Print a line where one is due."""
        if not due(weighing, self._reported, _period(weighing)) and news(weighing) == self._news:
            return
        self._reported, self._news = weighing.newest, news(weighing)
        self._console.print(plain_line(weighing), markup=False, highlight=False, soft_wrap=True)

    def close(self) -> None:
        """Nothing was begun."""


def _period(weighing: LiveWeighing) -> float:
    return _LINE_PERIOD if math.isfinite(weighing.mass) else _EARLY_PERIOD


def _through(stream: TextIO) -> list[tuple[logging.StreamHandler[TextIO], TextIO]]:
    """Let log lines to standard error go above the view, not into it; return what was where.

    The handlers were made before the view, with the stream that it draws on.
    """
    moved = []
    for handler in logging.getLogger().handlers:
        if type(handler) is logging.StreamHandler:
            moved.append((handler, handler.stream))
            handler.setStream(stream)
    return moved


def terminal(console: Console) -> TerminalView | PlainLines:
    """Choose how a weighing is shown: in place on a terminal, else in lines."""
    return TerminalView(console) if console.is_terminal else PlainLines(console)


def plain_line(weighing: LiveWeighing) -> str:
    """Write a weighing in one line."""
    parked = ", parked" if weighing.parked else ""
    parts = [f"{weighing.vehicle}, driven {duration(weighing.driven)}: {weighing.status}{parked}"]
    if reason := reason_text(weighing):
        parts[0] += f" ({reason})"
    if weighing.mass == weighing.mass:
        parts += [mass_text(weighing), payload_text(weighing)]
        if weighing.share is not None:
            parts.append(f"{100.0 * weighing.share:.0f} % of {kg(weighing.gross)}")
        parts.append(overload_text(weighing))
    parts += [needed_text(weighing), signals_text(weighing)]
    if not math.isfinite(weighing.mass):
        wanted, part = progress_text(weighing)
        parts[-2] = f"{100.0 * part:.0f} % of what {wanted} needs"
        parts += [rates_text(weighing), weighing.advice]
    return visible(cut("; ".join(part for part in (alerts_text(weighing), *parts) if part)))


class View:
    """One weighing, laid out to the room there is.

    Parameters
    ----------
    weighing : what is shown
    spare : lines of the terminal that stay free; one for the cursor at least
    """

    def __init__(self, weighing: LiveWeighing, spare: int = 1) -> None:
        self.weighing = weighing
        self._spare = spare

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> Iterator[Text]:
        height = console.size.height - self._spare
        yield from lines(self.weighing, options.max_width, height, ascii_only=options.ascii_only)


def lines(w: LiveWeighing, width: int, height: int, *, ascii_only: bool = False) -> list[Text]:
    """Lay a weighing out, the most important first where not all has room.

    Parameters
    ----------
    w : the weighing
    width, height : of the terminal [characters, lines]
    ascii_only : bars are drawn with letters that every terminal has
    """
    from rich.text import Text

    title = Text(visible(cut(w.vehicle, max(width - 18, 12))), style="bold")
    driven = f"driven {duration(w.driven)}"
    gap = width - title.cell_len - len(driven)
    if gap > 1:
        title.append(" " * gap + driven, style="not bold dim")
    bars = _bars(w, width, ascii_only=ascii_only)
    reason = _wrapped(
        capital(reason_text(w)), width, "yellow" if w.status is LiveStatus.LEARNING else "red"
    )
    advice = _wrapped(capital(w.advice), width, "cyan")
    load = ", ".join(t for t in (payload_text(w), overload_text(w)) if t)
    payload = _wrapped(load, width, _load_style(w))
    needed = _wrapped(needed_text(w), width)
    alerts = _wrapped(alerts_text(w), width, "bold white on red")
    head = [*alerts, _mass_line(w, width), *reason, *payload, *bars, *needed, *advice]
    if height < len(head) + 5:
        # Little room: what is known first.
        signals = _wrapped(signals_text(w), width, _signals_style(w))
        return [*head, *signals][: max(height, 1)]
    top = [title, Text(""), *head, Text("")]
    left = height - len(top)
    notes = [
        line
        for note in reversed([p.shown for p in w.problems if p.id != "live.alert"])
        for line in _wrapped(f"Note: {note}", width, "dim")
    ]
    table = _table(w.signals, width)
    if not w.signals or len(table) > left:
        table = _wrapped(signals_text(w), width, _signals_style(w))
    return [*top, *table, *notes][:height]


def _mass_line(w: LiveWeighing, width: int) -> Text:
    from rich.text import Text

    known = w.mass == w.mass
    line = Text(mass_text(w) if known else "no mass yet", style="bold")
    line.append("  ")
    line.append(f" {w.status} ", style=_STATUS_STYLE[w.status])
    if w.parked:
        line.append(" parked ", style="black on cyan")
    low, high = w.interval()
    reported = f"  {between(low, high)} with 95 %"
    if known and high - low < float("inf") and line.cell_len + len(reported) <= width:
        line.append(reported, style="dim")
    line.truncate(width)
    return line


def _bars(w: LiveWeighing, width: int, *, ascii_only: bool) -> list[Text]:
    found = []
    if w.share is not None:
        text = f"{100.0 * w.share:4.0f} % of {kg(w.gross)}"
        found.append(("permitted", w.share, _load_style(w), text))
    wanted, part = progress_text(w)
    found.append((f"to {wanted}", part, "cyan", f"{100.0 * part:4.0f} %"))
    if w.look == w.look:
        found.append(("next look", w.look, "cyan", f"{100.0 * w.look:4.0f} %"))
    room = max(len(text) for *_, text in found)
    length = max(min(width - 11 - room, 50), 5)
    return [_bar(*f, length, width, ascii_only=ascii_only) for f in found]


def _bar(
    name: str, part: float, style: str, text: str, length: int, width: int, *, ascii_only: bool
) -> Text:
    from rich.text import Text

    full, empty = ("#", "-") if ascii_only else ("█", "░")
    filled = round(min(max(part, 0.0), 1.0) * length)
    line = Text(f"{name:<10}")
    line.append(full * filled, style=style)
    line.append(empty * (length - filled), style="dim")
    line.append(f" {text}")
    line.truncate(width)
    return line


def _load_style(w: LiveWeighing) -> str:
    p = w.overload
    if p is None:
        return ""
    return "red" if p >= _LIKELY else "yellow" if p >= _QUESTIONABLE else "green"


def _signals_style(w: LiveWeighing) -> str:
    wrong = [s for s in w.signals if s.fails]
    return "red" if any(s.needed for s in wrong) else "yellow" if wrong else "dim"


def _table(signals: tuple[SignalHealth, ...], width: int) -> list[Text]:
    """Signals in one column, or in two where the terminal is wide; those that fail first."""
    from rich.text import Text

    ordered = sorted(signals, key=lambda s: (not s.fails, not s.needed))
    if width < _WIDE:
        return [_signal(s, width) for s in ordered]
    half = (width - 2) // 2
    rows = (len(ordered) + 1) // 2
    lines = []
    for k in range(rows):
        line = _signal(ordered[k], half)
        if k + rows < len(ordered):
            line = Text.assemble(line, "  ", _signal(ordered[k + rows], half))
        lines.append(line)
    return lines


def _signal(s: SignalHealth, width: int) -> Text:
    from rich.text import Text

    state = state_text(s)
    style = "red" if s.fails and s.needed else "yellow" if s.fails else "green"
    lost = s.late + s.unfit
    tail = f"{rate_text(s):>8}{age_text(s):>7} "
    room = max(min(width - len(tail) - 7, _LONGEST_NAME), 4)
    name = visible(s.name)
    line = Text(f"{name if len(name) <= room else name[: room - 1] + '…':<{room}}{tail}")
    line.append(f"{state:<6}", style=style)
    reported = f" {lost} lost"
    if lost and line.cell_len + len(reported) <= width:
        line.append(reported, style="dim")
    line.truncate(width, pad=True)
    return line


def _wrapped(text: str, width: int, style: str = "") -> list[Text]:
    """Break a sentence into lines of the width; none for no sentence."""
    from textwrap import wrap

    from rich.text import Text

    return [Text(part, style=style) for part in wrap(visible(cut(text)), max(width, 8))]
