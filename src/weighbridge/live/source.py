"""Where live samples come from."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from threading import Event
from typing import Protocol, TypeAlias

from weighbridge.signals import Floats

Samples: TypeAlias = Mapping[str, tuple[Floats, Floats]]
"""By canonical name of the signal: instants (n,) [s] and values (n,) in SI, in any order."""


class Source(Protocol):
    """A device, an interface or a file that samples come from.

    Attributes
    ----------
    name : what a person calls it, as on the command line
    """

    name: str

    def run(self, put: Callable[[Samples], None], stop: Event) -> None:
        """Hand samples over as they come, until there are no more or ``stop`` is set.

        Instants are those of the host's clock that never jumps
        (`weighbridge.live.clock.now`), except for a recorded drive, which keeps its own.

        Raises
        ------
        SourceError
            The device is gone or silent; it may be tried again.
        """
