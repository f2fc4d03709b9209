"""What a reader hands over: the signals of one file."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from weighbridge.io.frames import Frames
from weighbridge.io.mapping import TableMapping
from weighbridge.signals import DriveInfo, Floats, Problem, Signal, clean_columns


@dataclass(slots=True)
class Log:
    """The signals of one file, in SI, each on its own clock.

    Attributes
    ----------
    path : the file
    signals : cleaned
    problems : what was left out
    lacking : what a mapping names, not as optional, and the file does not have; serious unless
        another file of the drive has it
    absolute : whether the clock counts from 1970
    start : where the clock begins [s since 1970], if it does not count from there
        and the file shows; None otherwise
    of_day : whether the clock counts from midnight, of a day that the file does not show
    placed : whether a mapping gives the offset of its clock
    align : whether a mapping asks to align its clock with the drive's other files
    frames : raw bus traffic, decoded once all files of a drive are read
    info : what the file knows of the drive beside its signals
    units : suffixes of the units that signals were read in, by name
    pieces : the recordings of the file, where its clock begins anew in places; ``signals`` are
        then of the longest that rises
    """

    path: Path
    signals: list[Signal] = field(default_factory=list)
    problems: list[Problem] = field(default_factory=list)
    lacking: list[Problem] = field(default_factory=list)
    absolute: bool = False
    start: float | None = None
    of_day: bool = False
    placed: bool = False
    align: bool = False
    frames: Frames | None = None
    info: DriveInfo | None = None
    units: dict[str, str] = field(default_factory=dict)
    pieces: list[Log] = field(default_factory=list)

    def take(self, time: Floats, columns: Sequence[tuple[str, Floats]]) -> None:
        """Clean values in SI that share a clock, and add them as signals."""
        signals, problems = clean_columns(time, columns, self.path.name)
        self.signals += signals
        self.problems += problems

    @property
    def span(self) -> tuple[float, float]:
        """First and last stamp [s]; from after all to before all where there is none."""
        held = [s.time for s in self.signals if len(s)]
        if not held:
            return math.inf, -math.inf
        return min(float(t[0]) for t in held), max(float(t[-1]) for t in held)


Reader = Callable[[Path, "str | None", "TableMapping | None"], Log]
"""Reads a file, given the canonical table it is (None where one file holds all)
and the mapping for it (None for canonical names)."""
