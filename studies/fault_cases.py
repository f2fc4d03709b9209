"""Put faults into a drive, weigh it by every method, and judge what comes out."""

from __future__ import annotations

import math
import re
import tempfile
import traceback
import warnings
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
from fault_kinds import FAULTS, USUAL, Fault
from fault_subjects import METHODS, Subject, weigh_by_all, without_numbers

from weighbridge.calibration.run import calibrate
from weighbridge.errors import WeighbridgeError
from weighbridge.io import read_drive
from weighbridge.io.write import write_drive
from weighbridge.pipeline.weighing import Weighing, weigh
from weighbridge.signals import Drive
from weighbridge.vehicle.model import Vehicle

KINDS: Final = ("right", "reported", "silent", "refused", "traceback", "hang", "memory")
"""What can come of a case."""

NEAR: Final = 0.02
"""A mass so near to that of the undamaged drive is right [-]."""
FAR: Final = 0.03
FAR_STD: Final = 2.5
"""Wrong is beyond both, in parts of the mass and in standard deviations: of good intervals of
95 % one in twenty does not hold, one in eighty at 2.5."""


@dataclass(frozen=True)
class Case:
    """Faults of some severity in the drive of one vehicle; two are put in one after another."""

    faults: tuple[tuple[Fault, float], ...]
    vehicle: str

    @property
    def group(self) -> str:
        return self.faults[0][0].group if len(self.faults) == 1 else "pairs"

    @property
    def harmless(self) -> bool:
        return all(f.harmless for f, _ in self.faults)

    @property
    def must_tell(self) -> bool:
        return any(f.must_tell for f, _ in self.faults)

    @property
    def damage(self) -> str:
        return "+".join(f"{f.name}@{severity:g}" for f, severity in self.faults)

    @property
    def name(self) -> str:
        return f"{self.damage}/{self.vehicle}"


@dataclass(frozen=True)
class Outcome:
    """What one method made of one case.

    Attributes
    ----------
    kind : of `KINDS`
    error, std : of the mass over the true one [-]; NaN where there is none
    text : reason of a refusal, warning that names the fault, or last line of a traceback
    where : what refused: the status, or the stage that raised
    wider : standard deviation over that of the undamaged drive [-]
    """

    case: Case
    method: str
    kind: str
    error: float = math.nan
    std: float = math.nan
    text: str = ""
    where: str = ""
    wider: float = math.nan


def all_cases() -> list[Case]:
    """List every fault in every severity and vehicle it is meant for."""
    return [
        Case(((fault, float(severity)),), vehicle)
        for fault in FAULTS
        for severity in fault.severities
        for vehicle in fault.vehicles
    ]


def pairs(count: int, seed: int) -> list[Case]:
    """Draw pairs of faults of two groups, at most one of them harmless."""
    rng = np.random.default_rng([seed, 2])
    usable = [f for f in FAULTS if f.stage == "drive" and f.name not in ("undamaged", "cut_short")]
    made: list[Case] = []
    while len(made) < count:
        vehicle = USUAL[int(rng.integers(len(USUAL)))]
        first, second = (usable[int(k)] for k in rng.choice(len(usable), 2, replace=False))
        both = (first, second)
        if first.group == second.group or any(vehicle not in f.vehicles for f in both):
            continue
        drawn = [(f, float(f.severities[int(rng.integers(len(f.severities)))])) for f in both]
        made.append(Case(tuple(drawn), vehicle))
    return made


def subset(cases: Sequence[Case], seed: int) -> list[Case]:
    """Draw one severity and vehicle of each fault."""
    rng = np.random.default_rng([seed, 3])
    by_name: dict[str, list[Case]] = {}
    for case in cases:
        if case.vehicle in USUAL:
            by_name.setdefault(case.faults[0][0].name, []).append(case)
    return [found[int(rng.integers(len(found)))] for found in by_name.values()]


def random_of(case: Case) -> np.random.Generator:
    """Return the generator of a case, the same whichever others are run."""
    return np.random.default_rng(zlib.crc32(case.name.encode()))


def injected(case: Case, subject: Subject) -> Drive:
    """Put the faults of the signals into the subject's drive."""
    rng, drive = random_of(case), subject.drive
    for fault, severity in case.faults:
        if fault.stage == "drive":
            drive = fault.apply(drive, severity, rng)
        elif fault.stage == "splice":
            drive = fault.apply(drive, severity, rng, subject.other)
    return drive


def through_files(case: Case, drive: Drive, folder: Path) -> bool:
    """Write the drive and spoil its files; tell whether the case wants that."""
    of_files = [(f, severity) for f, severity in case.faults if f.stage == "files"]
    if of_files:
        write_drive(drive, folder, "csv")
    for fault, severity in of_files:
        fault.apply(folder, severity, random_of(case))
    return bool(of_files)


def vehicle_of(case: Case, subject: Subject) -> Vehicle:
    """Return the vehicle file, made or changed as the case wants it."""
    vehicle = subject.vehicle
    for fault, severity in case.faults:
        if fault.stage == "calibration":
            masses = fault.apply(list(subject.masses), severity)
            vehicle = calibrate(list(subject.known), masses, vehicle=subject.known_of)
        elif fault.stage == "vehicle":
            vehicle = replace(vehicle, tare=fault.apply(vehicle, subject.mean, severity))
    return vehicle


def run_case(case: Case, subject: Subject) -> list[Outcome]:
    """Do one case by every method that weighs the undamaged drive, or weighs this one.

    An exception of the fault itself is the study's and is raised.
    """
    return [
        o
        for o in _by_every_method(case, subject)
        if o.kind != "refused" or math.isfinite(subject.undamaged[o.method])
    ]


def _by_every_method(case: Case, subject: Subject) -> list[Outcome]:
    drive = injected(case, subject)
    with (
        tempfile.TemporaryDirectory() as place,
        warnings.catch_warnings(record=True) as caught,
    ):
        warnings.simplefilter("always", UserWarning)
        written = through_files(case, drive, Path(place) / "drive")
        stage = "reading" if written else "calibration"
        try:
            if written:
                drive = read_drive(Path(place) / "drive")
            vehicle = vehicle_of(case, subject)
            stage = "checks"
            weighed = weigh_by_all(drive, vehicle)
        except WeighbridgeError as error:
            return [Outcome(case, m, "refused", text=str(error), where=stage) for m in METHODS]
        except Exception as error:
            if stage == "checks" and not isinstance(error, MemoryError):
                return [_alone(case, subject, drive, vehicle, m) for m in METHODS]
            return [_broken(case, m, error) for m in METHODS]
    spoken = (str(w.message) for w in caught if issubclass(w.category, UserWarning))
    shared = (*weighed[0].warnings, *spoken)
    return [judge(case, subject, w, shared) for w in weighed]


def _alone(case: Case, subject: Subject, drive: Drive, vehicle: Vehicle, method: str) -> Outcome:
    """Do one method by itself where one of all broke."""
    try:
        return judge(case, subject, weigh(drive, vehicle, method))
    except WeighbridgeError as error:
        return Outcome(case, method, "refused", text=str(error), where="checks")
    except Exception as error:
        return _broken(case, method, error)


def _broken(case: Case, method: str, error: Exception) -> Outcome:
    frame = traceback.extract_tb(error.__traceback__)[-1]
    text = f"{type(error).__name__}: {error} ({Path(frame.filename).name}, {frame.name})"
    kind = "memory" if isinstance(error, MemoryError) else "traceback"
    return Outcome(case, method, kind, text=text)


def naming(fault: Fault, subject: Subject, told: Sequence[str]) -> str:
    """Return the first warning that names a fault and that the undamaged drive lacks."""
    words = re.compile(fault.words, re.IGNORECASE)
    fresh = (t for t in told if without_numbers(t) not in subject.warnings)
    return next((t for t in fresh if words.search(t)), "")


def telling(case: Case, subject: Subject, told: Sequence[str], method: str) -> str:
    """Return a warning where each fault of a case that spoils the mass is named; else nothing.

    A fault that is not named is put in alone: where the mass is right then, it is none of the
    reasons.
    """
    named = {f: naming(f, subject, told) for f, _ in case.faults}
    found = next((text for text in named.values() if text), "")
    if not found or len(case.faults) == 1:
        return found
    for fault, severity in case.faults:
        if named[fault] or fault.harmless:
            continue
        alone = run_case(Case(((fault, severity),), case.vehicle), subject)
        if any(o.method == method and o.kind != "right" for o in alone):
            return ""
    return found


def judge(case: Case, subject: Subject, weighing: Weighing, shared: Sequence[str] = ()) -> Outcome:
    """Judge a weighing by the truth, by its interval and by the undamaged drive.

    Parameters
    ----------
    shared : warnings of the drive, which methods that share its navigation do not repeat
    """
    method, mass = weighing.method, weighing.mass
    if not math.isfinite(mass):
        return Outcome(case, method, "refused", text=weighing.reason, where=str(weighing.status))
    truth = subject.truth(method)
    error, std = mass / truth - 1.0, weighing.std / truth
    low, high = weighing.interval(0.95)
    right = (
        low <= truth <= high
        or abs(mass / subject.undamaged[method] - 1.0) < NEAR
        or abs(error) <= max(FAR, FAR_STD * std, abs(subject.error(method)))
    )
    told = (*shared, *weighing.warnings)
    warning = telling(case, subject, told, method) if not right or case.must_tell else ""
    # A payload that may be nothing need not be reported; one that is unknown counts as impossible.
    possible = weighing.payload > -FAR_STD * weighing.std
    if case.must_tell and not warning and not possible:
        return Outcome(case, method, "silent", error, std, "nothing reports it")
    kind = "right" if right else "reported" if warning else "silent"
    wider = weighing.std / subject.stds[method]
    return Outcome(case, method, kind, error, std, warning, wider=wider)
