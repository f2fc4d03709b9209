"""Messages that tests make up, and errors by their id or by the values that they name."""

import re
import string
from collections.abc import Iterable, Iterator
from contextlib import contextmanager

import pytest

from weighbridge import DriveError, Problem
from weighbridge.messages import PARTS, _phrases, catalogue


def noted(text: str, **more: object) -> Problem:
    """Return a message with any text."""
    return Problem("plugin.note", text, **more)  # type: ignore[arg-type]


def named(text: str, *values: object) -> bool:
    """Return whether a text is one line that names each value, whatever its words.

    A string holds several values, with spaces between them. 5 is not named by 15, 5.2 or n5.
    """
    pieces = " ".join(map(str, values)).split()
    return len(text.splitlines()) == 1 and all(_named(text, piece) for piece in pieces)


def _named(text: str, piece: str) -> bool:
    before = r"(?<!\w)(?<!\d\.)" if re.match(r"\w", piece) else ""
    after = r"(?!\w)(?!\.\d)" if re.search(r"\w$", piece) else ""
    return re.search(before + re.escape(piece) + after, text) is not None


@contextmanager
def error(kind: type[Exception], *values: object) -> Iterator[pytest.ExceptionInfo]:
    """Expect an error of one line that names each value; see `named`."""
    with pytest.raises(kind) as found:
        yield found
    assert named(str(found.value), *values), (str(found.value), values)


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
