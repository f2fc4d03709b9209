"""Messages that tests make up, and errors by the id of their message."""

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from weighbridge.errors import DriveError
from weighbridge.signals import Problem


def noted(text: str, **more: object) -> Problem:
    """Return a message with any text."""
    return Problem("plugin.note", text, **more)  # type: ignore[arg-type]


@contextmanager
def refused(*ids: str) -> Iterator[pytest.ExceptionInfo[DriveError]]:
    """Expect an error of a drive whose message has one of the ids."""
    with pytest.raises(DriveError) as found:
        yield found
    assert found.value.problem is not None, found.value
    assert found.value.problem.id in ids, found.value
