"""The view of a live weighing, on terminals of any size and where there is none."""

import io
import logging
import math
from dataclasses import replace

import pytest
from rich.console import Console
from tests.noted import noted
from tests.unit.made_weighings import NAMES, drive, health, rests, weighing

from weighbridge import LiveStatus, Problem
from weighbridge.live import Alert
from weighbridge.live.outputs.terminal import (
    PlainLines,
    TerminalView,
    lines,
    plain_line,
    terminal,
)


def text(found):
    return "\n".join(line.plain for line in found)


def test_the_view_tells_mass_interval_payload_share_and_what_is_needed():
    shown = text(lines(weighing(), 80, 40))
    # 1.96 x 25 kg.
    for part in (
        "2100 ± 49 kg", "weighed", "2051 to 2149 kg with 95 %", "payload 300 kg",
        "88 % of 2400 kg", "± 5 %: reached", "± 2 %: 3 min more", "Speed up firmly",
        "overload probability less than 1 %", "vehicle_speed",
    ):  # fmt: skip
        assert part in shown, part


@pytest.mark.parametrize("width", [20, 40, 64, 80, 132])
@pytest.mark.parametrize("height", [1, 4, 9, 16, 23, 50])
def test_the_view_never_leaves_the_terminal(width, height):
    told = weighing(
        status=LiveStatus.INCONSISTENT,
        refusal=noted("The drive says two masses that contradict each other. " * 4),
        problems=(noted("A note that is longer than a line of any terminal it is on. " * 4),),
        signals=health(silent=("gnss_speed", "vehicle_speed")),
    )
    found = lines(told, width, height)
    assert len(found) <= height
    assert all(line.cell_len <= width for line in found)
    assert found[0].plain.strip()
    if width >= 40:
        assert "2100" in text(found[:3])


def test_a_small_terminal_names_the_signals_that_do_not_come():
    silent = weighing(signals=health(silent=("gnss_speed", "vehicle_speed")))
    shown = text(lines(silent, 80, 12))
    assert f"{len(NAMES) - 2} of {len(NAMES)} signals come; not: vehicle_speed, gnss_speed" in shown


def test_signals_that_fail_come_first_in_the_table():
    silent = weighing(signals=health(silent=("gnss_speed",)))
    rows = [line.plain for line in lines(silent, 80, 40) if " Hz" in line.plain]
    assert rows[0].startswith("gnss_speed")
    assert "absent" in rows[0]


def test_a_view_without_a_mass_or_permitted_mass_shows_what_there_is():
    none = weighing(mass=math.nan, std=math.nan, gross=None, tare=None, minutes_to_2=math.inf)
    shown = text(lines(none, 80, 24))
    assert "no mass yet" in shown
    assert "nan" not in shown.lower()
    assert "permitted" not in shown
    assert "± 2 %: not by driving on" in shown


def test_control_characters_of_a_name_do_not_act():
    assert "\x1b" not in text(lines(weighing(vehicle="van\x1b[2J"), 80, 24))


def test_bars_of_a_terminal_without_unicode_are_letters():
    shown = lines(weighing(progress_to_5=0.5), 80, 24, ascii_only=True)
    bars = [t.plain for t in shown if "##" in t.plain]
    assert len(bars) == 2
    assert all("█" not in bar for bar in bars)


def test_a_terminal_gets_a_view_and_a_pipe_lines():
    screen = Console(file=io.StringIO(), force_terminal=True, width=80, height=24)
    view = terminal(screen)
    view.close()
    assert isinstance(view, TerminalView)
    assert isinstance(terminal(Console(file=io.StringIO())), PlainLines)


def test_the_view_is_drawn_at_most_five_times_a_second_and_the_last_one_stays():
    out = io.StringIO()
    screen = Console(file=out, force_terminal=True, width=80, height=24)
    time = iter(range(1000))
    view = TerminalView(screen, clock=lambda: 0.01 * next(time))
    for k in range(100):
        view.show(weighing(mass=1000.0 + k))
    view.close()
    # 100 weighings within a second: five are drawn, and the newest when it closes.
    assert out.getvalue().count("weighed") == pytest.approx(6, abs=1)
    assert "1099 ± 49 kg" in out.getvalue()


def test_plain_lines_come_each_10_s_until_a_mass_and_then_each_minute_or_where_something_changes():
    printed, at = io.StringIO(), []
    view = PlainLines(Console(file=printed, width=40))
    told = list(drive(300))
    told[200:] = [replace(w, parked=True) for w in told[200:]]
    for w in told:
        before = printed.tell()
        view.show(w)
        if printed.tell() > before:
            at.append(w.newest - 1.0)
    weighed = next(w.time for w in told if w.status is LiveStatus.WEIGHED)
    assert at == [0.0, 10.0, 20.0, 30.0, 40.0, 50.0, weighed, weighed + 60.0, 200.0, 260.0]
    lines = printed.getvalue().splitlines()
    assert "0 % of what ± 5 % needs" in lines[0]
    assert "10 % of what ± 5 % needs" in lines[3]
    assert "vehicle_speed 5.0 Hz, engine_torque_fraction 5.0 Hz" in lines[3]
    assert "needs" not in lines[-1]
    assert "weighed, parked" in lines[-1]


def test_plain_lines_go_on_where_no_mass_has_a_time():
    """Before the first mass a weighing has no instant; the samples have."""
    out = io.StringIO()
    view = PlainLines(Console(file=out))
    for k in range(31):
        view.show(weighing(math.nan, newest=float(k), mass=math.nan, std=math.nan))
    view.show(weighing(math.nan, mass=math.nan, std=math.nan))
    assert len(out.getvalue().splitlines()) == 4


def test_an_active_alert_is_the_first_line():
    passed = replace(Alert(2400.0).state(weighing()), active=True, probability=0.97)
    w = weighing(alerts=(passed,), problems=(Problem.of("live.alert", alert="above 2400 kg"),))
    shown = [t.plain.strip() for t in lines(w, 60, 30)]
    assert next(line for line in shown if "2400 kg" in line).startswith(
        "Overload: above 2400 kg, 97 %"
    )
    assert not any("Note" in line for line in shown)
    assert lines(w, 60, 4)[0].plain.startswith("Overload")
    assert plain_line(w).startswith("Overload")
    assert "Overload" not in plain_line(weighing(alerts=(replace(passed, active=False),)))


def test_a_parked_vehicle_has_no_signal_that_fails():
    shown = [t.plain for t in lines(weighing(parked=True, signals=rests()), 40, 40)]
    assert any("parked" in line for line in shown)
    assert any(line.startswith("latitude") and "rests" in line for line in shown)
    assert "not:" not in plain_line(weighing(parked=True, signals=rests()))


def test_plain_lines_go_on_when_the_clock_begins_anew():
    out = io.StringIO()
    view = PlainLines(Console(file=out))
    for time in (5000.0, 5001.0, 10.0, 11.0):
        view.show(weighing(time))
    assert len(out.getvalue().splitlines()) == 2


def test_log_lines_stand_above_the_view_and_not_in_it():
    out = io.StringIO()
    handler = logging.StreamHandler(out)
    logging.getLogger().addHandler(handler)
    try:
        view = TerminalView(Console(file=out, force_terminal=True, width=80, height=24))
        view.show(weighing())
        before = len(out.getvalue())
        logging.getLogger("weighbridge.live").warning("the adapter is gone")
        told = out.getvalue()[before:]
        view.close()
    finally:
        logging.getLogger().removeHandler(handler)
    # The view is wiped, the line stands where it began, and the view follows.
    assert told.index("\x1b[2K") < told.index("the adapter is gone") < told.index("weighed")
    assert handler.stream is out


def test_a_payload_below_nothing_and_a_missing_limit_are_told():
    tared = weighing(tared=2150.0, gross=None)
    shown = text(lines(tared, 80, 40))
    assert "payload since the tare −50 kg, no permitted mass in the vehicle file" in shown
    assert "payload 0 kg" in text(lines(weighing(mass=1799.8), 80, 40))


@pytest.mark.parametrize(("width", "height"), [(80, 24), (60, 20)])
def test_the_last_view_leaves_room_for_what_is_said_after_it(width, height):
    """Its first line, which names the vehicle, stays on the screen however many notes there are."""
    out = io.StringIO()
    console = Console(file=out, force_terminal=True, width=width, height=height)
    view = TerminalView(console)
    for count in range(20):
        notes = tuple(noted(f"Note {k} of a drive that has many.") for k in range(count))
        view.show(weighing(problems=notes))
    view.close()
    last = out.getvalue().rsplit("\x1b[2K", 1)[-1]
    assert weighing().vehicle in last
    assert last.count("\n") <= height - 4
