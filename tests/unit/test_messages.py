"""The catalogue of messages: each renders, each is used, and each use names its values."""

import ast
import re
import string
import tomllib
from functools import cache
from pathlib import Path

import pytest

import weighbridge
from weighbridge import ConfigError, DriveError, Problem
from weighbridge.messages import PARTS, catalogue, phrase, refused

SOURCE = Path(weighbridge.__file__).parent
FILE = tomllib.loads((SOURCE / "messages.toml").read_text(encoding="utf-8"))
PHRASES = FILE["phrase"]
ALWAYS = {"signal", "start", "end"}


class Sample:
    """A value that any format takes: numbers by their codes, else a word."""

    def __format__(self, spec):
        if spec.endswith("X"):
            return format(26, spec)
        return format(1.25, spec) if spec[-1:] in ("f", "g") else "word"

    def __repr__(self):
        return "'word'"


def fields(text):
    return {name for _, name, _, _ in string.Formatter().parse(text) if name is not None}


def rendered(text):
    return text.format_map({name: Sample() for name in fields(text)})


def needed(id):
    return set().union(*(fields(part) for part in catalogue()[id].values()))


def literals(node):
    """Return the texts that an argument may be, of a literal or of one on a condition."""
    if isinstance(node, ast.Constant):
        return [node.value]
    if isinstance(node, ast.IfExp):
        return literals(node.body) + literals(node.orelse)
    return []


@cache
def nodes():
    """Return the calls and texts of the program, each with its file."""
    return [
        (path, node)
        for path in sorted(SOURCE.rglob("*.py"))
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Call | ast.Constant)
    ]


def name_of(function):
    """Return the dotted name of what is called; empty where it has none."""
    if isinstance(function, ast.Attribute) and isinstance(function.value, ast.Name):
        return f"{function.value.id}.{function.attr}"
    return function.id if isinstance(function, ast.Name) else ""


@cache
def calls():
    """Return the place, kind, ids and named values of each use of the catalogue in the program."""
    found = []
    for path, node in nodes():
        if not isinstance(node, ast.Call) or path.name == "messages.py":
            continue
        kind = name_of(node.func)
        if kind in ("Problem.of", "Message.of", "refused", "phrase"):
            names = {k.arg for k in node.keywords}
            place = f"{path.relative_to(SOURCE)}:{node.lineno}"
            found.append((place, kind, literals(node.args[0]), names))
    return found


@pytest.mark.parametrize("id", catalogue())
def test_a_message_renders(id):
    parts = catalogue()[id]
    assert re.fullmatch(r"[a-z]+\.[a-z0-9_]+", id)
    assert parts["text"]
    assert set(parts) <= set(PARTS)
    text = Problem.of(id, "signal", **dict.fromkeys(needed(id) - ALWAYS, Sample())).text
    assert not re.search(r"[{}]|  ", text)
    assert text[-1] not in ".;,:"
    assert [rendered(part) for part in parts.values()] == [
        part for part in map(rendered, parts.values()) if part == part.strip()
    ]


@pytest.mark.parametrize("name", PHRASES)
def test_a_phrase_renders(name):
    assert phrase(name, **dict.fromkeys(fields(PHRASES[name]), Sample())) == rendered(PHRASES[name])


def test_the_program_uses_messages_of_the_catalogue_only():
    assert len(calls()) > 300
    for place, kind, ids, _ in calls():
        known = PHRASES if kind == "phrase" else catalogue()
        assert [id for id in ids if id not in known] == [], place


def test_the_program_uses_each_message():
    texts = {
        node.value
        for _, node in nodes()
        if isinstance(node, ast.Constant) and isinstance(node.value, str)
    }
    assert [id for id in catalogue() if id not in texts] == []
    assert [name for name in PHRASES if name not in texts] == []


def test_each_use_names_the_values_of_its_message():
    for place, kind, ids, names in calls():
        for id in ids:
            if None in names:
                continue
            wanted = fields(PHRASES[id]) if kind == "phrase" else needed(id) - ALWAYS
            assert wanted - names == set(), (place, id)


def test_each_note_of_a_calibration_has_an_id_that_a_vehicle_file_keeps():
    told = Problem.of("calibration.delay_unknown")
    assert Problem.from_line(told.line) == told


def test_a_doubt_of_a_vehicle_file_of_before_is_read():
    found = Problem.from_line("the mass is doubtful: weigh it again")
    assert (found.id, found.text) == ("calibration.doubt", "the mass is doubtful: weigh it again")


def test_parts_of_a_message_are_one_sentence():
    told = {"share": 12.0, "vehicle": "car", "seen": 2500.0, "expected": 2000.0}
    found = Problem.of("gear.foreign", **told)
    parts = catalogue()["gear.foreign"]
    whole = "; ".join(parts[part] for part in PARTS if part in parts)
    assert found.text == whole.format(**told)
    assert found.values == told


def test_a_message_is_written_as_json_and_read_again():
    found = Problem.of("speed.stands", "vehicle_speed", start=1.25, end=9.0, duration=10.0)
    record = found.to_dict()
    assert list(record) == ["id", "signal", "from_s", "to_s", "text"]
    assert (record["from_s"], record["to_s"]) == (1.25, 9.0)
    assert Problem.from_dict(record) == found


def test_an_error_keeps_its_message():
    error = refused("speed.missing", drive="run")
    assert isinstance(error, DriveError)
    assert error.problem.id == "speed.missing"
    assert Problem.from_error(error).text == str(error)
    assert Problem.from_error(DriveError("broken: copy it again")).id == "file.unusable"


@pytest.mark.parametrize("id", ["", "clock", "Clock.step", "clock.step.more", "a text: of before"])
def test_an_id_of_another_form_is_refused(id):
    with pytest.raises(ConfigError, match=r"clock\.step"):
        Problem(id, "text")
