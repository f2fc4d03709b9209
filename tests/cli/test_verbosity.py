"""How much a command tells: --quiet and --verbose, bars and colours on a terminal."""

import os
import pty
import re
import subprocess
import sys

import numba
import pytest
import typer
from tests.cli.conftest import TERMINAL, written_to
from tests.cli.test_terminal import RUN
from tests.noted import named

from weighbridge.cli import app
from weighbridge.cli.progress import Bar, compiling, time_text

COLOUR = re.compile(r"\x1b\[(?:\d+;)*(?:3[0-7]|38;|9[0-7])")
SMALL = ("--vehicles", "1", "--days", "1", "--drives", "3", "--minutes", "2", "--workers", "1")
TIME_LEFT = re.compile(r"\d+ s left")


def leaves(command=None):
    command = typer.main.get_command(app) if command is None else command
    below = getattr(command, "commands", {}).values()
    return [leaf for one in below for leaf in leaves(one)] if below else [command]


def test_every_command_takes_them():
    found = leaves()
    assert len(found) >= 19
    for command in found:
        assert {"quiet", "verbose"} <= {option.name for option in command.params}, command.name


def test_the_terminal_breaks_the_lines_of_help():
    for command in leaves():
        assert command.help, command.name
        assert all("\n" not in part for part in command.help.split("\n\n")), command.name


def test_quiet_leaves_the_results(weighbridge, loaded, car, tmp_path):
    track = tmp_path / "track.csv"
    words = ["weigh", loaded.folder, "--vehicle", car, "--track", track]
    loud = weighbridge(*words)
    assert f"written: {track}" in loud.out
    for ran in (weighbridge("-q", *words), weighbridge(*words, "--quiet")):
        assert ran.code == loud.code == 0
        assert ran.err == ""
        assert ran.out == loud.out.replace(f"written: {track}\n", "")
        assert " kg, 95 % between " in ran.out


def test_quiet_leaves_errors(weighbridge, car):
    ran = weighbridge("weigh", "none", "--vehicle", car, "--quiet")
    assert ran.code == 2
    assert named(ran.err, "none")


def test_verbose_logs_each_drive_and_twice_each_stage(weighbridge, loaded, car):
    words = ["weigh", loaded.folder, "--vehicle", car]
    once = weighbridge(*words, "--verbose")
    assert re.search(r"^ *\d+\.\d\d s  io\.read: loaded: \d+ signals", once.err, re.MULTILINE)
    assert "pipeline.weighing: loaded: " in once.err
    assert "coarse mounting" not in once.err
    twice = weighbridge("-v", *words, "-v")
    assert "coarse mounting" in twice.err
    assert twice.out == once.out
    assert weighbridge(*words).err == ""


def test_both_are_refused(weighbridge):
    ran = weighbridge("-q", "doctor", "-v")
    assert ran.code == 2
    assert "exclude each other" in ran.err
    assert ran.err.count("\n") == 1


def test_a_bar_with_the_time_left_on_a_terminal_alone(on_a_terminal, weighbridge, tmp_path):
    code, shown = on_a_terminal("simulate", "fleet", "-o", tmp_path / "a", *SMALL)
    assert code == 0
    assert TIME_LEFT.search(shown)
    assert shown.count("drives of 1 vehicles") == 1
    code, shown = on_a_terminal("simulate", "fleet", "-o", tmp_path / "b", *SMALL, "--quiet")
    assert code == 0
    assert not TIME_LEFT.search(shown)
    ran = weighbridge("simulate", "fleet", "-o", tmp_path / "c", *SMALL)
    assert (ran.code, ran.err) == (0, "")


def test_colours_on_a_terminal_alone_and_not_where_they_are_unwanted(on_a_terminal, weighbridge):
    assert COLOUR.search(on_a_terminal("--help")[1])
    for words in (("--help",), ("doctor",)):
        assert not COLOUR.search(on_a_terminal(*words, NO_COLOR="1")[1])
    assert "\x1b" not in on_a_terminal("doctor", TERM="dumb")[1]
    assert "\x1b" not in weighbridge("--help").out


def test_nothing_is_left_on_the_terminal_after_the_last_line(loaded, car):
    """A process of its own: libraries write when it ends."""
    ours, its = pty.openpty()
    words = [sys.executable, "-c", RUN, "weigh", loaded.folder, "--vehicle", car]
    environment, written = {**os.environ, **TERMINAL}, []
    with subprocess.Popen(words, stdin=its, stdout=its, stderr=its, env=environment) as done:
        os.close(its)
        written_to(ours, written)
    assert done.returncode == 0
    assert b"\\x1b" not in b"".join(written)


def test_the_time_left_is_that_of_the_shares_that_are_left():
    now = [100.0]
    bar = Bar(10.0, clock=lambda: now[0])
    assert bar.left is None
    bar.begin("one", 2.0)
    assert bar.left is None
    now[0] = 104.0
    bar.begin("two", 4.0)
    assert bar.left == pytest.approx(16.0)
    now[0] = 107.0
    assert bar.left == pytest.approx(13.0)
    now[0] = 112.0
    bar.within(1, 2)
    assert bar.left == pytest.approx(18.0)
    now[0] = 150.0
    assert bar.left == 0.0
    bar.begin("three", 4.0)
    assert bar.done == 6.0


@pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="nothing is compiled")
def test_a_bar_says_while_kernels_compile_and_not_when_they_are_kept(monkeypatch):
    said = []
    bar = Bar(1.0)
    monkeypatch.setattr(bar, "say", lambda more="": said.append(more))

    @numba.njit
    def inner(x):
        return x + 1.0

    @numba.njit
    def outer(x):
        return inner(x)

    with compiling(bar):
        assert outer(1.0) == 2.0
        assert [text[-4:] for text in said] == [" (1)", " (2)", ""]
        outer(2.0)
    assert len(said) == 3


def test_times_are_told_for_people():
    assert [time_text(s) for s in (0.4, 59.6, 754.0, 7260.0)] == [
        "0 s",
        "1 min 00 s",
        "12 min 34 s",
        "2 h 01 min",
    ]


@pytest.mark.parametrize(
    ("typed", "offered"),
    [
        ("weighbridge we", "weigh"),
        ("weighbridge weigh --ve", "--vehicle"),
        ("weighbridge weigh x --method sp", "speed-torque-ekf"),
        ("weighbridge calibrate x --torque wh", "wheel_torque"),
        ("weighbridge vehicle new --class tr", "truck"),
        ("weighbridge simulate hi", "highway"),
        ("weighbridge simulate car --without sq", "squat"),
        ("weighbridge vehicle new --driven re", "rear"),
        ("weighbridge reproduce je", "jensen2022"),
        ("weighbridge convert x y --format pa", "parquet"),
        ("weighbridge live --source el", "elm:"),
    ],
)
def test_the_shell_completes(weighbridge, monkeypatch, typed, offered):
    monkeypatch.setenv("_WEIGHBRIDGE_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", typed)
    monkeypatch.setenv("COMP_CWORD", str(len(typed.split()) - 1))
    # Named by the program, not by the module that runs the tests.
    monkeypatch.setattr(sys.modules["__main__"], "__package__", None)
    assert offered in weighbridge().out.split()
