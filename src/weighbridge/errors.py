"""Exceptions for what a caller can correct.

Every message is one sentence or two that name the file or argument, the
offending value and the remedy. Poor data is not an exception but a result
(`weighbridge.Status`).
"""

from typing import Any

from weighbridge.visible import cut


class WeighbridgeError(Exception):
    """Base of all errors that a caller can correct; the command line exits with 2.

    Its text is cut to what a screen shows: what it quotes of a file may be endless.

    Attributes
    ----------
    problem : the `weighbridge.Problem` that it says, if the catalogue of messages has it; else None
    """

    problem: Any = None

    def __init__(self, text: str = "") -> None:
        super().__init__(cut(text))


class ConfigError(WeighbridgeError):
    """A vehicle file, a mapping or an argument holds an impossible value."""


class ArgumentTypeError(ConfigError, TypeError):
    """An argument is of another type than expected."""


class DriveError(WeighbridgeError):
    """A drive cannot be read, or its data cannot be right."""


class LostError(DriveError):
    """The navigation filter ended far from what it began with, or refused most fixes."""


class SourceError(WeighbridgeError):
    """A device or interface that samples come from is gone, silent or not what it should be."""


class MissingExtraError(WeighbridgeError):
    """An optional dependency is needed but not installed; ``extra`` is None if no extra has it."""

    def __init__(self, package: str, extra: str | None, purpose: str) -> None:
        install = package if extra is None else f'"weighbridge[{extra}]"'
        super().__init__(
            f"{purpose} needs the package {package!r}, which is not installed: "
            f"pip install {install}"
        )
