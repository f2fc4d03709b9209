"""The unit, the image and the script of the page on a Raspberry Pi name what there is."""

import re
import shlex

import pytest
import typer.main
from website.links import HOME

from weighbridge.cli import app

PLACES = (
    "docs/raspberry.md",
    "examples/raspberry/compile.sh",
    "examples/raspberry/weighbridge.service",
)


def commands(place):
    """Words of each command of weighbridge in a file, after its name."""
    text = (HOME / place).read_text(encoding="utf-8").replace("\\\n", " ")
    for line in text.splitlines():
        # In a container the command follows the name of the image.
        if found := re.search(r"weighbridge +(live|simulate|calibrate|doctor)\b(.*)", line):
            yield found[1], shlex.split(found[2])


@pytest.mark.parametrize("place", PLACES)
def test_each_option_is_one_of_the_command(place):
    known = typer.main.get_command(app).commands
    found = list(commands(place))
    assert found
    for name, words in found:
        command = known[name]
        # A command with others below it runs the first where none is named.
        command = getattr(command, "commands", {}).get("run", command)
        options = {o for p in command.params for o in (*p.opts, *p.secondary_opts)}
        assert {w for w in words if w.startswith("-")} <= options, (place, name)


def test_what_the_image_copies_is_there_and_let_through():
    lines = (HOME / "Dockerfile").read_text(encoding="utf-8").splitlines()
    let = {x[1:] for x in (HOME / ".dockerignore").read_text().split() if x.startswith("!")}
    copied = [w for line in lines if line.startswith("COPY") for w in line.split()[1:-1]]
    assert set(copied) == let
    assert all((HOME / name).exists() for name in copied)


def test_the_program_in_the_image_is_not_root_when_it_compiles_and_runs():
    lines = (HOME / "Dockerfile").read_text(encoding="utf-8").splitlines()
    begins = [line.partition(" ")[0] for line in lines]
    assert [line for line in lines if line.startswith("USER")] == ["USER weighbridge"]
    assert begins.index("USER") < lines.index("RUN sh /compile.sh") < begins.index("ENTRYPOINT")
