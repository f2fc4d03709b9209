"""Tables of records that other packages may add to."""

import sys
from dataclasses import dataclass

import pytest

from weighbridge import ConfigError
from weighbridge.registry import Registry


@dataclass(frozen=True)
class Record:
    name: str
    size: int = 0


OWN = (Record("small", 1), Record("large", 9))


@pytest.fixture
def package(tmp_path, monkeypatch):
    """Return what installs a package with one module and one entry point."""

    def install(name, code, point):
        (tmp_path / f"{name}.py").write_text(code)
        info = tmp_path / f"{name}-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
        (info / "entry_points.txt").write_text(f"[test.sizes]\n{point}\n")
        monkeypatch.syspath_prepend(tmp_path)
        monkeypatch.delitem(sys.modules, name, raising=False)

    return install


def sizes():
    return Registry(Record, "test.sizes", OWN)


def test_own_records_come_first_and_in_their_order(package):
    package(
        "added_1",
        f"from {__name__} import Record\nmiddle = Record('middle', 5)",
        "middle = added_1:middle",
    )
    table = sizes()
    assert list(table) == ["small", "large", "middle"]
    assert table["middle"].size == 5
    assert table.names == "small, large or middle"
    assert len(table) == 3


def test_an_own_name_asks_no_other_package(package):
    package("broken_1", "raise RuntimeError('not today')", "middle = broken_1:middle")
    assert sizes()["large"].size == 9


@pytest.mark.parametrize(
    ("code", "point", "why"),
    [
        ("raise RuntimeError('not today')", "middle = broken_2:middle", "not today"),
        ("middle = 5", "middle = broken_2:middle", "it is no Record"),
        ("middle = None", "middle = broken_2:other", "no attribute 'other'"),
        (f"from {__name__} import Record\nx = Record('huge')", "middle = broken_2:x", "'huge'"),
        (
            f"from {__name__} import Record\nx = Record('large')",
            "large = broken_2:x",
            "there is one",
        ),
    ],
)
def test_a_package_that_cannot_be_used_is_named(package, code, point, why):
    package("broken_2", code, point)
    with pytest.raises(ConfigError, match=why) as refusal:
        list(sizes())
    assert "of broken_2 in group test.sizes" in str(refusal.value)
    assert len(str(refusal.value).splitlines()) == 1


def test_an_unknown_name_is_no_record():
    assert sizes().get("middle") is None
    with pytest.raises(KeyError):
        sizes()["middle"]
