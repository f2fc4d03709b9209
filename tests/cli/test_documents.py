"""What README and docs tell to type and to call works as it stands there."""

import ast
import inspect
import re
import shlex
from pathlib import Path

import pytest
from typer.main import get_command

import weighbridge as wb
from weighbridge.cli.main import app
from weighbridge.io import to_frames

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
            assert rest[0] in command.commands, " ".join(words)
            command = command.commands[rest.pop(0)]
        known = {"--help", "--version"} | {o for p in command.params for o in p.opts}
        options = {w.partition("=")[0] for w in rest if re.match(r"--?[a-z]", w)}
        assert options <= known, " ".join(words)


@pytest.fixture(scope="module")
def five_minutes(tmp_path_factory):
    """Type the five minutes of README, in an empty folder."""
    folder = tmp_path_factory.mktemp("readme")
    (typed,) = (b for b in blocks(Path("README.md"), "bash") if "-o loaded/" in b)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        codes = [app(shlex.split(line)[1:], standalone_mode=False) for line in typed.splitlines()]
    assert set(codes) <= {None, 0}
    return folder


def test_the_five_minutes_end_with_a_report(five_minutes):
    assert (five_minutes / "loaded.html").read_bytes().startswith(b"<!DOCTYPE html>")
    assert (five_minutes / "track.csv").stat().st_size > 10_000


def test_the_five_minutes_in_python(five_minutes, monkeypatch):
    monkeypatch.chdir(five_minutes)
    for made in (five_minutes / "loaded.html", five_minutes / "car.toml"):
        made.unlink(missing_ok=True)
    frames = to_frames(wb.read_drive("loaded/"))
    (code,) = (b for b in blocks(Path("README.md"), "python") if "calib/" in b)
    names = {"obd": frames["obd"], "imu": frames["imu"].to_pandas()}
    exec(code, names)
    assert names["w"].interval(0.99)[0] < 1790.0 < names["w"].interval(0.99)[1]
    assert names["drive"].has("accel_x", "vehicle_speed")
    assert (five_minutes / "loaded.html").is_file()
    assert (five_minutes / "car.toml").is_file()


def test_functions_of_the_readme_take_what_it_gives_them():
    """Calls on files that only a reader has, by their signatures."""
    calls = [
        node
        for code in blocks(Path("README.md"), "python")
        for node in ast.walk(ast.parse(code))
        if isinstance(node, ast.Call)
        and isinstance(node.func, ast.Attribute)
        and isinstance(node.func.value, ast.Name)
        and node.func.value.id == "wb"
    ]
    assert {"mapping"} <= {k.arg for call in calls for k in call.keywords}
    for call in calls:
        keywords = {k.arg: None for k in call.keywords}
        inspect.signature(getattr(wb, call.func.attr)).bind(*call.args, **keywords)


@pytest.mark.parametrize(
    ("document", "code"),
    [(d, c) for d in DOCUMENTS if d.parts[0] == "docs" for c in blocks(d, "python")],
    ids=lambda part: str(part)[-12:] if isinstance(part, Path) else "code",
)
def test_python_of_the_documents_runs(document, code, tmp_path, five_minutes, monkeypatch):
    monkeypatch.chdir(five_minutes if "car.toml" in code else tmp_path)
    names = {}
    exec(code, names)
    assert {"drive", "scale"} & set(names), document
