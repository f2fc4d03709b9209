"""What README and docs tell to type and to call works as it stands there."""

import re
import shlex
import shutil
from pathlib import Path

import pytest
from tests.graded import climb, coasting
from typer.main import get_command
from website import running

from weighbridge.cli import app
from weighbridge.io import write_drive
from weighbridge.simulation import RideScenario, make_scenario, simulate_car, simulate_ride

HOME = Path(__file__).parents[2]
DOCUMENTS = sorted(
    p.relative_to(HOME)
    for p in (
        HOME / "README.md",
        HOME / "CONTRIBUTING.md",
        *(HOME / "docs").rglob("*.md"),
        *(p for p in (HOME / "studies").glob("*.md") if not p.name.endswith(".template.md")),
    )
)
EXECUTED = running.pages()
START = HOME / "docs" / "start.md"
HOW_TO = [p for p in EXECUTED if p.parent.name == "howto"]
TOLERANCE = 0.03
"""By which numbers of a page may differ from those of this processor."""


def blocks(document: Path, language: str) -> list[str]:
    """Return the fenced blocks of a language."""
    text = (HOME / document).read_text(encoding="utf-8")
    return re.findall(rf"```{language}\n(.*?)```", text, re.DOTALL)


def commands(document: Path) -> list[list[str]]:
    """Return the words of every ``weighbridge`` command, in blocks and in lines."""
    text = (HOME / document).read_text(encoding="utf-8")
    text = re.sub(r"\\\n\s*", "", text)
    found = re.findall(r"^(?:\$ )?weighbridge (.*)$", text, re.MULTILINE)
    found += re.findall(r"`weighbridge ([^`]+)`", text)
    return [shlex.split(re.sub("[\"']", "", command), comments=True) for command in found]


@pytest.mark.parametrize("document", DOCUMENTS, ids=str)
def test_commands_and_their_options_exist(document):
    top = get_command(app)
    for words in commands(document):
        command, rest = top, list(words)
        while hasattr(command, "commands") and rest and re.fullmatch(r"[a-z]+", rest[0]):
            if hasattr(command, "fallback") and rest[0] not in command.commands:
                break
            assert rest[0] in command.commands, " ".join(words)
            command = command.commands[rest.pop(0)]
        command = getattr(command, "fallback", command)
        known = {"--help", "--version"} | {o for p in command.params for o in p.opts}
        options = {w.partition("=")[0] for w in rest if re.match(r"--?[a-z]", w)}
        assert options <= known, " ".join(words)


@pytest.fixture(scope="module")
def five_minutes(tmp_path_factory):
    """Type the five minutes of docs/start.md, in an empty folder."""
    folder = tmp_path_factory.mktemp("start")
    said = list(running.run(START, folder))
    for block, _ in said:
        assert block.language == "bash"
    return folder, said


def test_the_five_minutes_say_what_the_page_shows(five_minutes):
    folder, said = five_minutes
    assert sum(block.output is not None for block, _ in said) >= 4
    for block, text in said:
        assert block.output is None or running.agrees(block.output, text, TOLERANCE), text
    assert (folder / "loaded.html").read_bytes().startswith(b"<!DOCTYPE html>")
    assert (folder / "track.csv").stat().st_size > 10_000


@pytest.mark.parametrize("page", HOW_TO, ids=lambda p: p.stem)
def test_the_how_to_pages_say_what_they_show(page, five_minutes):
    folder, _ = five_minutes
    for block, text in running.run(page, folder):
        assert block.output is None or running.agrees(block.output, text, TOLERANCE), text


@pytest.fixture(scope="module")
def own_drives(tmp_path_factory):
    """Return a folder with the drives that README, guide and methods name."""
    folder = tmp_path_factory.mktemp("own")
    write_drive(climb(1400.0, 60e3), folder / "climb")
    write_drive(coasting(1400.0, 0.0, runs=2)[0], folder / "run")
    for name, payload, seed in (("empty", 0.0, 1), ("loaded", 240.0, 2)):
        simulate_car(make_scenario("car-short", payload=payload, seed=seed)).write(folder / name)
    shutil.copytree(folder / "loaded", folder / "trip")
    return folder


@pytest.fixture(scope="module")
def own_car(own_drives):
    """Type the commands of the README; return the folder with the vehicle file, and the codes."""
    (typed,) = (b for b in blocks(Path("README.md"), "bash") if "calibrate" in b)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(own_drives)
        codes = [app(shlex.split(line)[1:], standalone_mode=False) for line in typed.splitlines()]
    return own_drives, codes


def test_the_commands_of_the_readme_weigh(own_car):
    folder, codes = own_car
    assert set(codes) <= {None, 0}
    assert (folder / "loaded.html").is_file()


@pytest.mark.slow
@pytest.mark.parametrize("page", running.OWN_DRIVES)
def test_the_pages_for_own_drives_run(page, own_car):
    folder, _ = own_car
    assert list(running.run(HOME / "docs" / page, folder))


def test_the_python_of_the_readme_weighs(own_drives, monkeypatch):
    monkeypatch.chdir(own_drives)
    (code,) = blocks(Path("README.md"), "python")
    names = {}
    exec(code, names)
    low, high = names["w"].interval(0.99)
    assert low < 1820.0 < high


@pytest.mark.parametrize(
    ("document", "code"),
    [
        (d, c)
        for d in DOCUMENTS
        # That of fleets runs on a fleet, in tests/docs/test_blocks.py, and that of the benchmark on
        # one, in tests/cli/test_benchmark.py.
        # Pages for drives of one's own run whole, above.
        if d.parts[0] == "docs"
        and not d.name.startswith(("fleet", "benchmark"))
        and HOME / d not in EXECUTED
        if d.as_posix().removeprefix("docs/") not in running.OWN_DRIVES
        for c in blocks(d, "python")
    ],
    ids=lambda part: str(part)[-12:] if isinstance(part, Path) else "code",
)
def test_python_of_the_documents_runs(document, code, tmp_path, five_minutes, monkeypatch):
    monkeypatch.chdir(five_minutes[0] if "car.toml" in code else tmp_path)
    if "ride/" in code:
        write_drive(simulate_ride(RideScenario(duration=3.0, seed=3)).drive, tmp_path / "ride")
        shutil.copy(HOME / "examples/ride-truck/vehicle.toml", tmp_path / "truck.toml")
    names = {}
    exec(code, names)
    assert {"drive", "scale"} & set(names), document
