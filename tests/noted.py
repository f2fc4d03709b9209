"""Messages that tests make up, and errors by the id of their message."""

import re
import string
from collections.abc import Iterable, Iterator
from contextlib import contextmanager

import pytest

from weighbridge.errors import DriveError
from weighbridge.messages import PARTS, _phrases, catalogue
from weighbridge.signals import Problem


def noted(text: str, **more: object) -> Problem:
    """Return a message with any text."""
    return Problem("plugin.note", text, **more)  # type: ignore[arg-type]


@contextmanager
def refused(*ids: str, **values: object) -> Iterator[pytest.ExceptionInfo[DriveError]]:
    """Expect an error of a drive whose message has one of the ids, and these among its values."""
    with pytest.raises(DriveError) as found:
        yield found
    assert found.value.problem is not None, found.value
    assert found.value.problem.id in ids, found.value
    assert has([found.value.problem], *ids, **values), found.value.problem.values


def has(told: Iterable[Problem], /, *ids: str, **values: object) -> bool:
    """Return whether a message of one of the ids, with these values or signal, is among those told.

    A number agrees with what is expected by ``==``, so also with ``pytest.approx``.
    """
    return any(
        p.id in ids and all({"signal": p.signal, **p.values}.get(k) == values[k] for k in values)
        for p in told
    )


def words(id: str, /, **values: object) -> re.Pattern[str]:
    """Return what a text with the message or phrase matches: any value where none is given."""
    parts = catalogue()[id] if "." in id else {"text": _phrases()[id]}
    found = "; ".join(parts[part] for part in PARTS if part in parts)
    pieces = []
    for literal, name, spec, kind in string.Formatter().parse(found):
        pieces.append(re.escape(literal))
        if name is None:
            continue
        field = f"{{{name}{'!' + kind if kind else ''}{':' + spec if spec else ''}}}"
        pieces.append(re.escape(field.format_map(values)) if name in values else ".+?")
    return re.compile("".join(pieces), re.DOTALL)


def says(text: str, id: str, /, **values: object) -> bool:
    """Return whether a text holds the words of a message or phrase, with these values."""
    return words(id, **values).search(text) is not None
