"""Numbers in sentences."""

from __future__ import annotations


def counted(number: int, noun: str, plural: str = "") -> str:
    """Write a number with its noun: ``1 frame``, ``3 frames``.

    Parameters
    ----------
    number : how many
    noun : of one
    plural : of several, where an s at the end does not make it
    """
    return f"{number} {noun if number == 1 else plural or noun + 's'}"
