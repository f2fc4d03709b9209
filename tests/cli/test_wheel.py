"""What is released: wheel and source are built, and the wheel holds all that the program reads."""

import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

from weighbridge import __version__

ROOT = Path(__file__).parents[2]
COMPILED = "__pycache__"
"""Folder of what Python and the kernels compiled at a first run."""


@pytest.fixture(scope="module")
def built(tmp_path_factory) -> Path:
    """Build the source, and the wheel of that source; return their folder."""
    folder = tmp_path_factory.mktemp("dist")
    words = [sys.executable, "-m", "build", "--no-isolation", "--outdir", str(folder), str(ROOT)]
    ran = subprocess.run(words, capture_output=True, text=True, cwd=folder, check=False)
    assert ran.returncode == 0, ran.stdout + ran.stderr
    return folder


@pytest.fixture(scope="module")
def inside(built) -> set[str]:
    with zipfile.ZipFile(built / f"weighbridge-{__version__}-py3-none-any.whl") as wheel:
        return set(wheel.namelist())


def files(below: Path) -> set[str]:
    return {
        path.relative_to(ROOT / "src").as_posix()
        for path in below.rglob("*")
        if path.is_file() and COMPILED not in path.parts
    }


@pytest.mark.slow
def test_the_wheel_has_each_file_of_the_package(inside):
    package = files(ROOT / "src" / "weighbridge")
    assert {name for name in inside if name.startswith("weighbridge/")} == package
    assert {
        "weighbridge/py.typed",
        "weighbridge/report/page.js",
        "weighbridge/report/plotly/plotly-basic.min.js",
        "weighbridge/fleet/page.js",
        "weighbridge/live/outputs/static/index.html",
        "weighbridge/io/openpilot.capnp",
    } <= package


@pytest.mark.slow
def test_the_wheel_has_the_licence_of_each_script_in_it(inside):
    place = f"weighbridge-{__version__}.dist-info/licenses"
    below = (ROOT / "src").rglob("LICENSE")
    stated = {f"{place}/{path.relative_to(ROOT).as_posix()}" for path in below}
    assert len(stated) == 2
    assert {f"{place}/LICENSE"} | stated <= inside


@pytest.mark.slow
def test_the_source_has_what_builds_and_tests_it(built):
    with tarfile.open(built / f"weighbridge-{__version__}.tar.gz") as source:
        names = {name.partition("/")[2] for name in source.getnames()}
    wanted = {"pyproject.toml", "README.md", "LICENSE", "mkdocs.yml", "website/hooks.py"}
    assert wanted | {"tests/conftest.py", "docs/index.md", "examples/bus/vehicle.toml"} <= names
