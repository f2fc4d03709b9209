"""Names of other loggers' columns."""

import tomllib
from pathlib import Path

import pytest

from weighbridge.io.naming import is_time, recognise_all

HEADERS = tomllib.loads((Path(__file__).parent / "logger_headers.toml").read_text("utf-8"))
LEAST_RIGHT = 0.95


def read(columns):
    """What each name of a header is taken for."""
    names = [name for name, _ in columns]
    found = recognise_all(names)
    return ["time" if is_time(n) else f.quantity for n, f in zip(names, found, strict=True)]


def test_nearly_all_columns_of_public_loggers_are_named_right():
    assert len(HEADERS) >= 20
    right = total = 0
    wrong = []
    for app, told in HEADERS.items():
        for (name, meant), found in zip(told["columns"], read(told["columns"]), strict=True):
            total += 1
            right += found == meant
            if found != meant:
                wrong.append(f"{app}: {name!r} is {meant or 'none'}, taken for {found or 'none'}")
    assert right >= LEAST_RIGHT * total, "\n".join(wrong)
    # A wrong name is worse than none.
    assert sum(" for none" not in w for w in wrong) <= 0.01 * total, "\n".join(wrong)


@pytest.mark.parametrize("app", HEADERS)
def test_no_quantity_is_named_twice(app):
    found = [q for q in read(HEADERS[app]["columns"]) if q not in ("", "time")]
    assert len(found) == len(set(found))
