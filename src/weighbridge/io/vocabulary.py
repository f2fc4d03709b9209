"""Words of loggers, out of `names.ini`: for quantities, times and units, and against them."""

from __future__ import annotations

from collections.abc import Iterable
from configparser import ConfigParser
from typing import Final

from weighbridge.data import text_of

_FILE: Final = ConfigParser(interpolation=None, delimiters="=")
_FILE.read_string(text_of("io", "names.ini"))


def words_in(name: str) -> dict[str, tuple[str, ...]]:
    """Phrases of a section of `names.ini` by its keys; a star is each axis."""
    found = {}
    for key, text in _FILE[name].items():
        phrases = [" ".join(phrase.split()) for phrase in text.split(",")]
        for axis in "xyz" if "*" in key else "*":
            found[key.replace("*", axis)] = tuple(p.replace("*", axis) for p in phrases)
    return found


def _keys_by_word(name: str) -> dict[str, str]:
    return {word: key for key, words in words_in(name).items() for word in words}


_NAMES: Final = [words_in(name) for name in _FILE.sections() if name.split()[0] == "names"]

PHRASES: Final = {
    quantity: tuple(phrase for each in _NAMES for phrase in each.get(quantity, ()))
    for quantity in dict.fromkeys(quantity for each in _NAMES for quantity in each)
}
"""What loggers call each quantity, in any language."""

TIME_PHRASES: Final = frozenset(words_in("times")["names"])
"""What loggers call their time, likewise."""

COUNTERS: Final = frozenset(("", *words_in("times")["counters"]))
"""What loggers call a number that counts their rows; it may have no name."""

TIME_WORDS: Final = frozenset(words_in("times")["words"])
"""Words that make a name likely to be that of a time."""

BARE: Final = words_in("bare")
"""Names that only say in what something is measured, by what it may be where the values fit."""

AGAINST: Final = {quantity: frozenset(words) for quantity, words in words_in("against").items()}
"""Words with which a name means something else."""

LONG: Final = _keys_by_word("short")
"""Words by their shortened spelling."""

WORDS: Final = {kind: frozenset(words) for kind, words in words_in("words").items()}
"""Words of names by what they are, as `names.ini` explains."""

SILENT: Final = WORDS["noise"] | WORDS["senders"]
"""Words that say nothing of the quantity, but who sends it or that it is measured."""

ASPECTS: Final = {quantity: frozenset(words) for quantity, words in words_in("aspects").items()}
"""Words that show how a quantity is measured, or where: with or without them it is the same."""

UNIT_TEXTS: Final = _keys_by_word("units")
"""Units as people and loggers write them, and the suffix each means."""

SPELLED_UNITS: Final = _keys_by_word("units in words")
"""Words of units that are spelled out."""

OF_ANOTHER: Final = WORDS["another"]
"""Words of a request, a bound, an average, a check or a state of a signal."""


def spelled(words: Iterable[str]) -> tuple[str, ...]:
    """Spell shortened words out."""
    return tuple(LONG.get(word, word) for word in words)
