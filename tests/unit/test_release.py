"""What a release states about itself agrees: version, date, licences, supported Pythons."""

import re
import tomllib
from pathlib import Path

import pytest
from tests import licences

from weighbridge import __version__

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


def text(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


def released() -> tuple[str, str]:
    """Version and date of the newest release in the changelog."""
    found = re.search(r"^## (\d+\.\d+\.\d+) \((\d{4}-\d\d-\d\d)\)$", text("CHANGELOG.md"), re.M)
    assert found, "the changelog has no heading such as '## 0.2.0 (2026-11-23)'"
    return found[1], found[2]


def test_the_version_stands_in_one_place():
    assert PROJECT["project"]["dynamic"] == ["version"]
    assert "version" not in PROJECT["project"]
    where = PROJECT["tool"]["hatch"]["version"]
    found = re.search(where["pattern"], text(where["path"]), re.M)
    assert found["version"] == __version__


def test_changelog_and_citation_agree_with_the_version():
    version, date = released()
    citation = text("CITATION.cff")
    assert version == __version__
    assert re.search(r"^version: (.+)$", citation, re.M)[1] == __version__
    assert re.search(r"^date-released: (.+)$", citation, re.M)[1] == date


def test_classifiers_name_no_python_below_the_least():
    least = PROJECT["project"]["requires-python"].removeprefix(">=")
    prefix = "Programming Language :: Python :: 3."
    named = [c.removeprefix(prefix) for c in PROJECT["project"]["classifiers"]]
    minors = [int(minor) for minor in named if minor.isdigit()]
    assert minors == list(range(int(least.removeprefix("3.")), max(minors) + 1))


def rows() -> dict[str, str]:
    return dict(re.findall(r"^\|([^|\s]+)\|([^|]+)\|", text("docs/licences.md"), re.M))


@pytest.mark.parametrize("name", licences.needed())
def test_the_licence_of_each_package_is_listed(name):
    listed, stated = (licences.identifiers(t) for t in (rows()[name], licences.licence(name)))
    assert listed[0] == stated[0]


def test_no_package_is_listed_that_is_not_needed():
    assert set(rows()) - {"---", "package", "what", "uPlot", "plotly.js"} == set(licences.needed())
