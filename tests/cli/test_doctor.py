"""What the doctor tells of an installation."""

import json
import os
import subprocess
import sys
import tomllib
from importlib import metadata
from pathlib import Path

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
DEVELOPERS = {"dev", "studies", "docs"}
TURNED = "from weighbridge.kernels.rotation import half_turn; half_turn(1.0, 0.0, 0.0)"
NO_PLACE = """
from weighbridge.kernels import _jit
def nowhere(function):
    raise RuntimeError("no locator available")
_jit._Cache = nowhere
"""
RUN = "from weighbridge.__main__ import run; run()"


def told(cache: Path | str, code: str = RUN) -> tuple[int, dict]:
    """Run the doctor in a process of its own with a folder for compiled kernels."""
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(cache)}
    environment.pop("NUMBA_DISABLE_JIT", None)
    ran = subprocess.run(
        [sys.executable, "-c", code, "doctor", "--json", "-"],
        capture_output=True,
        text=True,
        env=environment,
        check=False,
    )
    return ran.returncode, json.loads(ran.stdout)


def test_the_packages_told_are_those_of_the_project(tmp_path):
    _, found = told(tmp_path)
    extras = {e["name"]: {p["name"] for p in e["packages"]} for e in found["extras"]}
    assert set(extras) == set(PROJECT["optional-dependencies"]) - DEVELOPERS
    names = {package["name"] for package in found["packages"]}
    assert {"numpy", "numba", "typer", "packaging"} <= names
    assert "asammdf" not in names
    assert extras["mdf"] == {"asammdf"}
    assert {"asammdf", "h5py", "pycapnp"} <= extras["formats"]


def test_the_cache_is_counted_and_grows_with_each_kernel(tmp_path):
    code, found = told(tmp_path)
    assert code == 0
    assert found["amiss"] == []
    assert found["cache"]["compiled"] == 0
    assert found["cache"]["kernels"] > 100
    assert found["cache"]["writable"]
    code, found = told(tmp_path, f"{TURNED}\n{RUN}")
    assert code == 0
    assert found["cache"]["compiled"] >= 1
    assert found["cache"]["size_bytes"] > 1000
    assert Path(found["cache"]["folder"]).is_relative_to(tmp_path)


def test_kernels_that_are_not_kept_are_amiss(tmp_path):
    code, found = told(tmp_path, f"{NO_PLACE}\n{RUN}")
    assert code == 1
    assert found["cache"]["folder"] is None
    assert "NUMBA_CACHE_DIR" in found["amiss"][0]


def test_what_is_missing_is_told_with_its_remedy(weighbridge, monkeypatch):
    real = metadata.version

    def version(name):
        if name in ("asammdf", "scipy"):
            raise metadata.PackageNotFoundError(name)
        return "1.9" if name == "numpy" else real(name)

    monkeypatch.setattr(metadata, "version", version)
    ran = weighbridge("doctor")
    text = " ".join(ran.out.split())
    assert ran.code == 1
    assert "missing: asammdf" in text
    assert "weighbridge[mdf,can]" in text
    assert 'amiss: scipy is missing: pip install "scipy>=1.12"' in text
    assert "amiss: numpy 1.9 does not fit >=1.26" in text
    assert text.count("amiss: ") == 2


def test_a_page_and_json_in_a_file(weighbridge, tmp_path):
    path = tmp_path / "doctor.json"
    ran = weighbridge("doctor", "--json", path)
    assert ran.out.startswith("weighbridge ")
    assert "compiled kernels: " in ran.out
    found = json.loads(path.read_text())
    assert {package["name"] for package in found["packages"]} >= {"numpy", "polars"}
    assert found["python"] in ran.out
