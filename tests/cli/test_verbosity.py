"""How much a command tells: --quiet and --verbose, bars and colours on a terminal."""

import os
import pty
import re
import subprocess
import sys

import numba
import pytest
import typer
from tests.cli.test_terminal import RUN, started

from weighbridge.cli.main import app
from weighbridge.cli.progress import Bar, compiling, time_text
from weighbridge.cli.verbosity import _leaves

COLOUR = re.compile(r"\x1b\[(?:\d+;)*(?:3[0-7]|38;|9[0-7])")
SMALL = ("--vehicles", "1", "--days", "1", "--drives", "3", "--minutes", "2", "--workers", "1")
TIME_LEFT = re.compile(r"\d+ s left")


def on_a_terminal(*words, **environment):
    """Run the command line on a terminal of its own; return its exit status and all it wrote."""
    ours, its = pty.openpty()
    unset = {"NO_COLOR", "FORCE_COLOR", "TERM", "COLUMNS"}
    kept = {name: value for name, value in os.environ.items() if name not in unset}
    done = subprocess.Popen(
        [sys.executable, "-c", RUN, *map(os.fspath, words)],
        stdin=its,
        stdout=its,
        stderr=its,
        env={**kept, "TERM": "xterm-256color", "COLUMNS": "90", **environment},
    )
    os.close(its)
    written = b""
    while True:
        try:
            block = os.read(ours, 65536)
        except OSError:
            break
        if not block:
            break
        written += block
    os.close(ours)
    return done.wait(), written.decode()


def leaves():
    root = typer.main.get_command(app)
    return list(_leaves(root.commands.values()))


def test_every_command_takes_them():
    found = leaves()
    assert len(found) >= 19
    for command in found:
        assert {"quiet", "verbose"} <= {option.name for option in command.params}, command.name


def test_the_terminal_breaks_the_lines_of_help():
    for command in leaves():
        assert command.help, command.name
        assert all("\n" not in part for part in command.help.split("\n\n")), command.name


@pytest.mark.parametrize("before", [True, False])
def test_quiet_leaves_the_results(weighbridge, loaded, car, tmp_path, before):
    track = tmp_path / "track.csv"
    words = ["weigh", loaded.folder, "--vehicle", car, "--track", track]
    loud = weighbridge(*words)
    ran = weighbridge(*(["-q", *words] if before else [*words, "--quiet"]))
    assert ran.code == loud.code == 0
    assert ran.err == ""
    assert f"written: {track}" in loud.out
    assert ran.out == loud.out.replace(f"written: {track}\n", "")
    assert " kg, 95 % between " in ran.out


def test_quiet_leaves_errors(weighbridge, car):
    assert "no such file" in weighbridge("weigh", "none", "--vehicle", car, "--quiet").err


def test_verbose_logs_each_drive_and_twice_each_stage(weighbridge, loaded, car):
    words = ["weigh", loaded.folder, "--vehicle", car]
    once = weighbridge(*words, "--verbose")
    assert re.search(r"^ *\d+\.\d\d s  io\.read: loaded: \d+ signals", once.err, re.MULTILINE)
    assert "pipeline.weighing: loaded: " in once.err
    assert "coarse mounting" not in once.err
    for twice in (weighbridge("-v", *words, "-v"), weighbridge(*words, "-vv")):
        assert "coarse mounting" in twice.err
        assert twice.out == once.out
    assert weighbridge(*words).err == ""


def test_both_are_refused(weighbridge):
    ran = weighbridge("-q", "doctor", "-v")
    assert ran.code == 2
    assert "exclude each other" in ran.err
    assert ran.err.count("\n") == 1


def test_a_bar_with_the_time_left_on_a_terminal_alone(tmp_path):
    code, shown = on_a_terminal("simulate", "fleet", "-o", tmp_path / "a", *SMALL)
    assert code == 0
    assert TIME_LEFT.search(shown)
    assert shown.count("drives of 1 vehicles") == 1
    code, shown = on_a_terminal("simulate", "fleet", "-o", tmp_path / "b", *SMALL, "--quiet")
    assert code == 0
    assert not TIME_LEFT.search(shown)
    ran = started("simulate", "fleet", "-o", tmp_path / "c", *SMALL)
    assert (ran.returncode, ran.stderr) == (0, b"")


def test_colours_on_a_terminal_alone_and_not_where_they_are_unwanted():
    assert COLOUR.search(on_a_terminal("--help")[1])
    for words in (("--help",), ("doctor",)):
        assert not COLOUR.search(on_a_terminal(*words, NO_COLOR="1")[1])
    assert "\x1b" not in on_a_terminal("doctor", TERM="dumb")[1]
    assert b"\x1b" not in started("--help").stdout


def test_nothing_is_left_on_the_terminal_after_the_last_line(loaded, car):
    code, shown = on_a_terminal("weigh", loaded.folder, "--vehicle", car)
    assert code == 0
    assert "\\x1b" not in shown


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
def test_the_shell_completes(typed, offered):
    environment = {
        "_WEIGHBRIDGE_COMPLETE": "complete_bash",
        "COMP_WORDS": typed,
        "COMP_CWORD": str(len(typed.split()) - 1),
    }
    code = f"import sys; sys.argv[0] = 'weighbridge'; {RUN}"
    ran = started(code=code, **environment)
    assert offered in ran.stdout.decode().split()
