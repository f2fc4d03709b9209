"""What reaches the terminal: no control character of a file, and a quiet end."""

import base64
import gzip
import io
import json
import os
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from weighbridge.cli.terminal import Terminal, console, guarded, say, say_json, shown

GOLDEN = Path(__file__).parent.parent / "golden"
RUN = "from weighbridge.__main__ import run; run()"

EVIL = "\x1b]0;title\x07\x1b[31mred\x9b31m\u202etxet\x08\r\x7f\u2066"
"""A title of the window, colours in two ways, text turned round, steps back."""

ACTS = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u200e\u200f\u202a-\u202e\u2066-\u2069]")

VEHICLE = (
    "[vehicle]\nname = 'x'\n[torque]\nsource = 'measured'\n"
    "[mounting]\nroll_deg = 0\npitch_deg = 0\nyaw_deg = 0\n"
)


def started(*words, stdout=subprocess.PIPE, code=RUN, **environment):
    """Run the command line in a process of its own."""
    return subprocess.run(
        [sys.executable, "-c", code, *map(os.fspath, words)],
        stdout=stdout,
        stderr=subprocess.PIPE,
        stdin=subprocess.DEVNULL,
        env={**os.environ, **environment},
        check=False,
    )


@pytest.fixture
def drive(tmp_path) -> Path:
    return Path(shutil.copytree(GOLDEN / "csv", tmp_path / f"d{EVIL}"))


@pytest.fixture
def car(tmp_path) -> Path:
    path = tmp_path / "car.toml"
    path.write_text(VEHICLE)
    return path


def harmless(ran, *words):
    assert not ACTS.search(ran.out + ran.err)
    for word in words:
        assert word in ran.out + ran.err


def test_names_of_folders(weighbridge, drive, car):
    harmless(weighbridge("inspect", drive), "\\x1b[31mred\\x9b31m\\u202etxet")
    harmless(weighbridge("weigh", drive, "--vehicle", car), "\\x1b[31mred")
    harmless(weighbridge("weigh", drive, drive, "--vehicle", car), "\\x1b[31mred")
    ran = weighbridge("weigh", drive, "--vehicle", car, "--json", "-")
    harmless(ran)
    assert "red" in json.loads(ran.out)["drive"]
    harmless(weighbridge("inspect", f"no{EVIL}"), "\\x1b[31mred")


def test_a_name_of_several_lines_is_one(weighbridge, tmp_path, car):
    folder = shutil.copytree(GOLDEN / "csv", tmp_path / "x\nweighbridge: 900 kg")
    ran = weighbridge("weigh", folder, "--vehicle", car)
    assert "x\\nweighbridge: 900 kg" in ran.out
    assert not any(line.startswith("weighbridge: 900") for line in ran.out.splitlines())


def test_usage_errors(weighbridge):
    ran = weighbridge("inspect", f"--no{EVIL}")
    harmless(ran, "\\x1b[31mred")
    assert ran.code == 2
    assert ran.err.count("\n") == 1


@pytest.mark.parametrize(
    "text",
    [
        '"\\u001b[31mkey\\u202e" = 1\n',
        '[vehicle]\nname = 3\n"\\u001b[31m" = 2',
        '[vehicle]\nclass = "\\u001b[31m\\u0007"',
        '[vehicle]\ntare_kg = "\\u001b[2J"',
        '[vehicle]\nmapping = "\\u001b[2J\\u0000"',
        '["\\u001b[31m"]\nx = 1',
        "x = \x1b[31m",
    ],
)
def test_vehicle_files(weighbridge, drive, car, text):
    car.write_text(text)
    ran = weighbridge("weigh", drive, "--vehicle", car)
    assert ran.code == 2
    harmless(ran)
    assert ran.err.count("\n") == 1


def test_names_and_units_inside_files(weighbridge, drive, tmp_path, car):
    car.write_text(VEHICLE.replace("'x'", '"\\u001b[31mcar\\u202e"'))
    obd = drive / "obd.csv"
    lines = obd.read_text().splitlines()
    obd.write_text(
        "\n".join([f"{lines[0]},x{EVIL[:12]}", *(f"{line},\x1b[31mcell" for line in lines[1:])])
    )
    report = tmp_path / "r.html"
    ran = weighbridge("weigh", drive, "--vehicle", car, "--compare", "--report", report)
    harmless(ran)
    page = report.read_text(encoding="utf-8")
    own = page[: page.index("<script>")]
    assert not ACTS.search(own)
    data = re.search(r'id="figures">(.*?)</script>', page, re.DOTALL)[1]
    figures = json.loads(gzip.decompress(base64.b64decode(data)))
    assert figures
    assert not ACTS.search(json.dumps(figures, ensure_ascii=False))
    assert "\\x1b[31mcar" in own
    harmless(weighbridge("inspect", drive), "\\x1b")


def test_texts_of_a_dbc(weighbridge, tmp_path):
    dbc = tmp_path / "x.dbc"
    text = (GOLDEN / "golden.dbc").read_text(encoding="cp1252")
    dbc.write_text(text.replace("Sensor", "Sen\x1b[31msor"), encoding="cp1252")
    harmless(weighbridge("inspect", GOLDEN / "can.blf", "--dbc", dbc))
    dbc.write_text("BO_ 1 \x1b[31mX: 8 Y\n SG_ \x1b[2J", encoding="cp1252")
    harmless(weighbridge("inspect", GOLDEN / "can.blf", "--dbc", dbc))


def test_a_terminal_outlives_the_stream_below():
    below = io.StringIO()
    terminal = Terminal(below)
    terminal.write("last words")
    below.close()
    terminal.flush()
    assert not terminal.isatty()
    terminal.close()


def test_marks_of_tables_are_text(weighbridge, tmp_path):
    folder = shutil.copytree(GOLDEN / "csv", tmp_path / "[red]x[/] [link=http://a.b]y[/link]")
    ran = weighbridge("inspect", folder)
    assert folder.name in ran.out


def test_styled_tables_escape_what_they_hold(capsys):
    with guarded():
        screen = console(force_terminal=True, color_system="standard")
        screen.print(f"[bold]{shown(EVIL)}[/] \x1b[5m raw")
        say(EVIL)
    out = capsys.readouterr().out
    assert "\x1b[1m" in out
    assert "\x1b[31m" not in out
    assert "\x1b[5m" not in out
    assert not ACTS.search(re.sub("\x1b\\[[0-9;]*m", "", out))


def test_bugs_keep_their_traceback_and_escape_what_they_show(weighbridge, monkeypatch, capsys):
    def broken(*_):
        raise ZeroDivisionError("\x1b[31mx")

    monkeypatch.setattr("weighbridge.pipeline.inspection.inspect_drive", broken)
    monkeypatch.setattr(sys, "excepthook", None)
    with pytest.raises(ZeroDivisionError) as bug:
        weighbridge("inspect", GOLDEN / "csv")
    sys.excepthook(bug.type, bug.value, bug.tb)
    shown = capsys.readouterr().err
    assert "Traceback" in shown
    assert "\\x1b[31mx" in shown
    assert "\x1b" not in shown


def test_long_messages_are_cut(weighbridge, tmp_path):
    log = tmp_path / "x.csv"
    log.write_bytes(
        b"time_s," + b"a" * 1_000_000 + b",vehicle_speed_kmh\n1,2,3\n2,2," + b"b" * 9999
    )
    ran = weighbridge("inspect", log)
    assert len(ran.out) < 20_000
    assert "characters left out" in ran.out
    ran = weighbridge("inspect", log, "--mapping", "m" * 5000)
    assert len(ran.err) < 2100


def test_a_terminal_of_ascii():
    for environment in (
        {"PYTHONIOENCODING": "ascii"},
        {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
    ):
        ran = started("Fährt – 比", **environment)
        assert (ran.returncode, ran.stdout, ran.stderr.count(b"\n")) == (2, b"", 1)
        assert any(f in ran.stderr for f in (b"\\u6bd4", b"\\udce6\\udcaf\\udc94"))
        assert ran.stderr.isascii()


def test_json_in_ascii_is_json(tmp_path, capsys):
    with guarded():
        sys.stdout.below.reconfigure(encoding="ascii")
        say_json('{"drive": "Fährt 🚗 \x9b"}')
        sys.stdout.below.reconfigure(encoding="utf-8")
    assert json.loads(capsys.readouterr().out) == {"drive": "Fährt 🚗 \x9b"}


def test_names_that_are_no_utf8(weighbridge, tmp_path):
    folder = os.fsencode(tmp_path) + b"/dr\xe9ve"
    shutil.copytree(os.fsencode(GOLDEN / "csv"), folder)
    (tmp_path / "car.toml").write_text(VEHICLE)
    named = os.fsdecode(folder)
    ran = weighbridge("inspect", named)
    assert ran.code == 0, ran.err
    assert "dr\\xe9ve" in ran.out
    results = ("--json", f"{named}/r\udce9.json", "--report", tmp_path / "r.html")
    track = ("--track", f"{named}/t\udce9.csv")
    ran = weighbridge("weigh", named, "--vehicle", tmp_path / "car.toml", *results, *track)
    assert ran.code == 1, ran.err
    assert {b"r\xe9.json", b"t\xe9.csv"} <= set(os.listdir(folder))  # noqa: PTH208  (bytes)
    assert (
        json.loads(Path(os.fsdecode(folder + b"/r\xe9.json")).read_text())["drive"] == "dr\\xe9ve"
    )
    assert "dr\\xe9ve" in (tmp_path / "r.html").read_text(encoding="utf-8")
    ran = weighbridge("convert", named, f"{tmp_path}/\udce9")
    assert ran.code == 0, ran.err


@pytest.mark.parametrize("words", [("doctor",), ("--help",)])
def test_a_reader_that_is_gone_ends_the_command_quietly(words):
    reader, writer = os.pipe()
    os.close(reader)
    ran = started(*words, stdout=writer)
    os.close(writer)
    assert (ran.returncode, ran.stderr) == (141, b"")


def test_a_full_standard_output_is_one_sentence():
    with Path("/dev/full").open("wb") as full:
        ran = started("--version", stdout=full)
    assert ran.returncode == 2
    assert ran.stderr == b"weighbridge: standard output: No space left on device\n"


def test_closed_streams_are_no_place_for_files(tmp_path):
    code = f"import os, sys\nos.close(1); os.close(2)\n{RUN}"
    ran = started("convert", GOLDEN / "parquet", tmp_path / "out", code=code)
    assert ran.returncode == 0
    assert (tmp_path / "out" / "imu.parquet").stat().st_size > 1000


@pytest.mark.parametrize("module", ["typer", "polars", "scipy", "numpy.linalg"])
def test_an_interruption_while_importing_is_quiet(module):
    code = f"""
import os, signal, sys
class Interrupting:
    def find_spec(self, name, path=None, target=None):
        if name == {module!r}:
            sys.meta_path.remove(self)
            os.kill(os.getpid(), signal.SIGINT)
sys.meta_path.insert(0, Interrupting())
{RUN}
"""
    ran = started("weigh", GOLDEN / "csv", "--vehicle", "none.toml", code=code)
    if ran.returncode == 2:
        # The module is not needed for what is wrong here.
        ran = started("inspect", GOLDEN / "csv", code=code)
    assert (ran.returncode, ran.stderr) == (130, b"")


def test_an_interruption_turned_into_another_error_is_one(weighbridge, monkeypatch):
    def broken(*_):
        try:
            os.kill(os.getpid(), signal.SIGINT)
            while True:
                pass
        except KeyboardInterrupt:
            raise ImportError("numpy.core.multiarray failed to import") from None

    monkeypatch.setattr("weighbridge.pipeline.inspection.inspect_drive", broken)
    ran = weighbridge("inspect", GOLDEN / "csv")
    assert (ran.code, ran.err) == (130, "")


def test_interruptions_that_are_ignored_stay_so(weighbridge):
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        assert weighbridge("inspect", GOLDEN / "csv").code == 0
        assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, before)
