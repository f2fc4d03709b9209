"""Patterns of file names that distinguish the kinds of file of a drive, on other days too."""

from __future__ import annotations

import glob
import re
from collections.abc import Sequence
from fnmatch import fnmatch
from itertools import takewhile
from pathlib import Path
from typing import Final

_DATED: Final = re.compile(r"\d+(?:[-_. T:hms]{1,3}\d+)*")
"""Numbers in a row, as of a date and a time."""

_DIGITS: Final = 3
"""Digits of a date, a time or a running number, at least; fewer may name a device or a bus."""


def file_patterns(kinds: Sequence[Sequence[str]], others: Sequence[str] = ()) -> list[str]:
    """Patterns that distinguish the kinds of file of a drive, and fit those of other drives.

    What all names share before and after what differs, such as a date, may be anything, and so
    may a date, a time or a running number of each.

    Parameters
    ----------
    kinds : names of the files of each kind
    others : names of files that are of no kind, such as those that cannot be read; where a date
        alone shows one from a file of a kind, that kind's pattern may fit it

    Returns
    -------
    One for each kind; empty where there are none that fit its own files alone.
    """
    if all(len(names) == 1 for names in kinds):
        single = [names[0] for names in kinds]
        inner = _inner(single)
        choices = [[_undated(p) for p in inner], list(map(glob.escape, single))]
        choices.insert(1, inner)
    else:
        choices = [[_of_kind(names) for names in kinds]]
    return next((found for found in choices if _apart(found, kinds, others)), [])


def _apart(patterns: Sequence[str], kinds: Sequence[Sequence[str]], others: Sequence[str]) -> bool:
    """Whether each pattern fits the files of its kind and no other."""
    for pattern, own in zip(patterns, kinds, strict=True):
        alike = set(map(undated, own))
        foreign = [n for names in kinds if names is not own for n in names]
        foreign += [n for n in others if undated(n) not in alike]
        if not pattern.removesuffix(Path(own[0]).suffix).strip("*"):
            return False
        if not all(_fits(n, pattern) for n in own) or any(_fits(n, pattern) for n in foreign):
            return False
    return True


def _fits(name: str, pattern: str) -> bool:
    return fnmatch(name.lower(), pattern.lower())


def _inner(names: Sequence[str]) -> list[str]:
    """Patterns of what differs between names."""
    stems = [Path(name).stem for name in names]
    several = stems if len(stems) > 1 else []
    before = _common_words(several)
    after = _common_words([stem[::-1] for stem in several])
    found = []
    for name, stem in zip(names, stems, strict=True):
        inner = stem[len(before) : max(len(stem) - len(after), len(before))]
        pattern = f"{'*' if before else ''}{glob.escape(inner)}{'*' if after else ''}"
        found.append(pattern + glob.escape(name.removeprefix(stem)))
    return found


def _of_kind(names: Sequence[str]) -> str:
    """Pattern of the names of one kind: dates may be anything, else what differs."""
    without_dates = list(dict.fromkeys(map(undated, names)))
    if len(without_dates) == 1:
        return without_dates[0]
    stems = [Path(name).stem for name in names]
    before = _common(stems)
    after = _common([stem[len(before) :][::-1] for stem in stems])[::-1]
    return f"{glob.escape(before)}*{glob.escape(after)}{glob.escape(Path(names[0]).suffix)}"


def undated(name: str) -> str:
    """Pattern of a name in which a date, a time or a running number may be anything."""
    return _undated(glob.escape(name))


def _undated(pattern: str) -> str:
    """Let a date, a time or a running number be anything; at the beginning it stays a number."""

    def anything(found: re.Match[str]) -> str:
        if sum(map(str.isdigit, found.group())) < _DIGITS:
            return found.group()
        return "*" if found.start() else "[0-9]*"

    return _DATED.sub(anything, pattern)


def _common_words(texts: Sequence[str]) -> str:
    """What all texts begin with, to the end of a word."""
    text = _common(texts)
    return text[: max((k + 1 for k, c in enumerate(text) if not c.isalnum()), default=0)]


def _common(texts: Sequence[str]) -> str:
    """What all texts begin with."""
    same = takewhile(lambda letters: len(set(letters)) == 1, zip(*texts, strict=False))
    return "".join(letters[0] for letters in same)
