"""JSON lines of live weighings."""

import json
import math
import pickle
import resource
import subprocess
import sys

import pytest
from tests.noted import error
from tests.unit.made_weighings import drive, weighing

from weighbridge import ConfigError, WeighbridgeError
from weighbridge.live import Lines, Outputs


def test_each_line_is_one_weighing_and_is_out_at_once(tmp_path):
    path = tmp_path / "masses.jsonl"
    written = Lines(path)
    for k, w in enumerate(drive(5)):
        written.show(w)
        rows = path.read_text().splitlines()
        assert json.loads(rows[k]) == json.loads(json.dumps(w.to_dict()))
    written.close()


def test_standard_output_gets_lines(capsys):
    Lines("-").show(weighing())
    out = capsys.readouterr().out
    assert out.endswith("\n")
    assert json.loads(out)["mass_kg"] == 2100.0


def test_numbers_that_are_not_finite_and_control_characters_stay_json(capsys):
    Lines("-").show(weighing(std=math.inf, driven=math.nan, vehicle="a\x7f\x1b\u202eü"))
    line = capsys.readouterr().out.removesuffix("\n")
    assert line.isascii()
    assert line.isprintable()
    found = json.loads(line, parse_constant=pytest.fail)
    assert found["interval95_kg"] == [None, None]
    assert found["vehicle"] == "a\x7f\x1b\u202eü"


@pytest.mark.parametrize(
    ("end", "kept"), [(b'{"mass_kg": 21', 1), (b'{"mass_kg": 1}', 2), (b"\n", 1), (b"{", 1)]
)
def test_a_torn_last_line_is_removed_and_a_whole_one_kept(tmp_path, end, kept):
    path = tmp_path / "masses.jsonl"
    path.write_bytes(b'{"mass_kg": 0}' + (b"\n" if end != b"\n" else b"") + end)
    written = Lines(path)
    written.show(weighing())
    written.close()
    rows = [json.loads(row) for row in path.read_text().splitlines()]
    assert len(rows) == kept + 1
    assert rows[-1]["mass_kg"] == 2100.0


def test_what_holds_no_json_lines_is_refused_and_kept(tmp_path):
    path = tmp_path / "car.toml"
    path.write_text("[vehicle]\n")
    with error(ConfigError, "car.toml JSON"):
        Lines(path)
    assert path.read_text() == "[vehicle]\n"


def test_a_folder_is_refused_in_a_sentence(tmp_path):
    with error(ConfigError, tmp_path):
        Lines(tmp_path)


FULL = """
import pickle, resource, signal, sys
from dataclasses import replace
from weighbridge.errors import ConfigError
from weighbridge.live import Lines
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
lines = Lines(sys.argv[1])
weighing = pickle.load(sys.stdin.buffer)
lines.show(weighing)
resource.setrlimit(resource.RLIMIT_FSIZE, (4000, resource.RLIM_INFINITY))
for k in range(3):
    try:
        lines.show(weighing)
    except ConfigError as error:
        print(error)
resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY,) * 2)
lines.show(replace(weighing, mass=1.0))
"""


def test_a_full_disk_is_told_and_leaves_whole_lines(tmp_path):
    path = tmp_path / "masses.jsonl"
    words = [sys.executable, "-c", FULL, str(path)]
    ran = subprocess.run(words, input=pickle.dumps(weighing()), capture_output=True, check=True)
    assert str(path) in ran.stdout.decode()
    lines = path.read_text().splitlines()
    assert len(lines[0]) > 1400
    rows = [json.loads(line) for line in lines]
    assert rows[-1]["mass_kg"] == 1.0
    assert resource.getrlimit(resource.RLIMIT_FSIZE)[0] == resource.RLIM_INFINITY


class Failing:
    name = "a place"

    def __init__(self):
        self.fails = True
        self.seen = 0
        self.closed = False

    def show(self, weighing):
        if self.fails:
            raise WeighbridgeError("a place is gone")
        self.seen += 1

    def close(self):
        self.closed = True


def test_a_failing_output_is_told_once_and_stops_no_other(caplog):
    bad, good = Failing(), Failing()
    good.fails = False
    with Outputs([bad, good]) as outputs:
        for w in drive(10):
            outputs.show(w)
        bad.fails = False
        outputs.show(weighing())
    assert good.seen == 11
    assert bad.seen == 1
    assert [r.message for r in caplog.records] == ["a place is gone", "a place is written again"]
    assert bad.closed
    assert good.closed
