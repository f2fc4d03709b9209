"""docs/loggers.md: its commands as they stand there, and what they say."""

import re
import shlex
import sys
from pathlib import Path

import pytest

from weighbridge import cli

HOME = Path(__file__).parents[2]
PAGE = (HOME / "docs" / "loggers.md").read_text(encoding="utf-8")
KINDS = ("bash", "text")
ROWS = [
    (title, *(re.search(rf"```{kind}\n(.*?)```", text, re.S)[1].splitlines() for kind in KINDS))
    for title, text in re.findall(r"^## (.*?)\n(.*?)(?=^## |\Z)", PAGE, re.S | re.M)
]
"""Title, commands and what is told, of each recording of the page."""

NAMES = [title.partition(":")[0] for title, _, _ in ROWS]
NUMBER = re.compile(r"\d+(?:\.\d+)?")

WITHIN = 0.01
"""Numbers of another machine may differ by the last digits of its arithmetic [-]."""


@pytest.fixture
def folder(shared_data, tmp_path, monkeypatch):
    """Return a folder as the page describes it."""
    for data in shared_data.iterdir():
        (tmp_path / data.name).symlink_to(data)
    (tmp_path / "examples").symlink_to(HOME / "examples")
    monkeypatch.chdir(tmp_path)
    # Lines of the page are not cut as those of a narrow terminal.
    monkeypatch.setenv("COLUMNS", "400")
    return tmp_path


def run(command, capsys, monkeypatch):
    monkeypatch.setattr(sys, "argv", shlex.split(command))
    capsys.readouterr()
    try:
        cli.run()
    except SystemExit as leaving:
        return leaving.code or 0, "".join(capsys.readouterr())
    return 0, "".join(capsys.readouterr())


def same(told, said):
    """Whether a line of the page is in what was said, its numbers within `WITHIN`."""
    pattern = f"({NUMBER.pattern})".join(map(re.escape, NUMBER.split(" ".join(told.split()))))
    numbers = [float(n) for n in NUMBER.findall(told)]
    return any(
        all(abs(float(a) - b) <= WITHIN * b for a, b in zip(found.groups(), numbers, strict=True))
        for found in re.finditer(pattern, said)
    )


def test_the_page_has_its_recordings():
    assert len(ROWS) >= 7
    assert all(1 <= len(commands) <= 4 for _, commands, _ in ROWS)
    assert sum(commands[0].startswith("weighbridge map ") for _, commands, _ in ROWS) >= 4


@pytest.mark.slow
@pytest.mark.parametrize(("title", "commands", "told"), ROWS, ids=NAMES)
def test_the_commands_of_the_page_say_what_it_tells(
    title, commands, told, folder, capsys, monkeypatch
):
    for command in commands[:-1]:
        code, said = run(command, capsys, monkeypatch)
        assert code == 0, f"{command}: {said}"
    code, said = run(commands[-1], capsys, monkeypatch)
    mass = re.search(r": \d+ kg, 95 %", told[0])
    assert (code == 0) == (mass is not None), said
    for line in told:
        assert same(line, " ".join(said.split())), f"{line!r} is not in {said}"
