"""The pairs of drive and vehicle: what is weighed with what, and in which slice it counts."""

from __future__ import annotations

import tempfile
import zlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Final, NamedTuple

import fault_subjects
import numpy as np
from fault_cases import Case, all_cases, injected, through_files, vehicle_of
from fault_cases import pairs as pairs_of_faults
from studies.corpus.subjects import MADE, MADE_BY_GEARBOX, READ, SHARED, Subject, absent, subject

import weighbridge as wb
from weighbridge.signals import QUANTITIES, Drive, Signal
from weighbridge.vehicle.air import standard_pressure
from weighbridge.vehicle.model import Vehicle

IMU: Final = ("accel_x", "accel_y", "accel_z", "gyro_x", "gyro_y", "gyro_z")
GNSS: Final = (
    "latitude", "longitude", "altitude", "gnss_speed", "gnss_course", "hdop", "gnss_accuracy",
)  # fmt: skip
PAIRED: Final = 60
"""Pairs of faults that are drawn."""

CUT: Final = 300.0
"""Length of a cut [s]."""


class Made(NamedTuple):
    """What is weighed: a drive, by a vehicle file, and its true mass [kg] (NaN if unknown)."""

    drive: Drive
    vehicle: Vehicle
    true: float


@dataclass(frozen=True)
class Pair:
    """A drive and a vehicle.

    Attributes
    ----------
    id : unique; it stays when pairs are added
    slice : that it counts in
    of : name of the subject it is made from; empty for what is read from files
    equipment : of the calibration; empty where the vehicle is not calibrated
    make : from the subject and its vehicle file
    sound : the drive is undamaged: it must be weighed
    reference : pair whose problems are no news here; empty without
    """

    id: str
    slice: str
    of: str
    equipment: str
    make: Callable[[Subject, Vehicle], Made]
    sound: bool
    reference: str = ""


# --- equipment -----------------------------------------------------------------------------------


def every(drive: Drive, names: tuple[str, ...], period: float) -> Drive:
    """Keep of signals the samples nearest to an even clock: sampling without a filter."""
    kept = []
    for name in names:
        s = drive.get(name)
        if s is None or s.period >= period:
            continue
        wanted = np.arange(s.time[0], s.time[-1], period)
        at = np.unique(np.minimum(np.searchsorted(s.time, wanted), s.time.size - 1))
        kept.append(Signal(name, s.time[at], s.values[at]))
    return drive.with_signals(*kept)


def polled(drive: Drive, period: float) -> Drive:
    """Thin all that is neither inertial sensor nor GNSS."""
    return every(drive, tuple(n for n in drive.signals if n not in (*IMU, *GNSS)), period)


def one_axis(drive: Drive) -> Drive:
    """Leave one accelerometer along the vehicle, at 50 Hz."""
    along = drive.signals["accel_x"]
    rest = drive.without(*IMU).with_signals(Signal("longitudinal_accel", along.time, along.values))
    return every(rest, ("longitudinal_accel",), 0.02)


EQUIPMENT: Final[dict[str, Callable[[Drive], Drive]]] = {
    "full": lambda d: d,
    "no GNSS": lambda d: d.without(*GNSS),
    "fixes every 5 s": lambda d: every(d, GNSS, 5.0),
    "IMU 50 Hz, OBD 1 Hz": lambda d: polled(every(d, IMU, 0.02), 1.0),
    "IMU 20 Hz": lambda d: every(d, IMU, 0.05),
    "IMU 10 Hz": lambda d: every(d, IMU, 0.1),
    "IMU 5 Hz": lambda d: every(d, IMU, 0.2),
    "one axis": one_axis,
    "no IMU": lambda d: d.without(*IMU),
    "no IMU, OBD 1 Hz": lambda d: polled(d.without(*IMU), 1.0),
}
"""What every subject is seen through."""

OTHER_EQUIPMENT: Final[dict[str, Callable[[Drive], Drive]]] = {
    "accelerometer alone": lambda d: d.without(*IMU[3:]),
    "speed alone": lambda d: d.without(*IMU, *GNSS),
    "calculated axis": lambda d: _derived(d),
    "torque cut off": lambda d: _cut_off(d),
    "no IMU, torque cut off": lambda d: _cut_off(d.without(*IMU)),
}
"""What some are seen through."""

CALIBRATED_BY: Final = {"speed alone": "no IMU", "calculated axis": "one axis"}
"""Where it is not the equipment itself."""


def seen_through(equipment: str, drive: Drive) -> Drive:
    """Return a drive as an equipment records it."""
    return (EQUIPMENT | OTHER_EQUIPMENT)[equipment](drive)


OF_TRUCK: Final = ("no IMU", "no IMU, OBD 1 Hz")
"""What a recording without an inertial sensor can be thinned to."""


def calibrated(of: str, equipment: str) -> Vehicle:
    """Calibrate a subject with its known drives, seen through an equipment."""
    one = subject(of)
    return wb.calibrate(
        [seen_through(equipment, drive) for drive, _ in one.known],
        [mass for _, mass in one.known],
        vehicle=one.base,
    )


# --- how pairs are made --------------------------------------------------------------------------


def _seen(one: Subject, vehicle: Vehicle, *, drive: str, equipment: str) -> Made:
    recorded, true = one.drives[drive]
    return Made(seen_through(equipment, recorded), vehicle, true)


def _cut(one: Subject, vehicle: Vehicle, *, drive: str, part: float, equipment: str) -> Made:
    recorded, true = one.drives[drive]
    begin = recorded.start + part * max(recorded.duration - CUT, 0.0)
    return Made(EQUIPMENT[equipment](recorded.between(begin, begin + CUT)), vehicle, true)


def _cut_off_clock(one: Subject, vehicle: Vehicle, *, drive: str, part: float, late: float) -> Made:
    """Set the clock of the bus wrong in a cut [s]."""
    made = _cut(one, vehicle, drive=drive, part=part, equipment="full")
    bus = [s for s in made.drive.signals.values() if QUANTITIES[s.name].table == "obd"]
    moved = (replace(s, time=s.time + late) for s in bus)
    return made._replace(drive=made.drive.with_signals(*moved))


def _off_clock(
    one: Subject, vehicle: Vehicle, *, drive: str, names: Sequence[str], late: float, grows: float
) -> Made:
    """Make signals late without an inertial sensor, and later until the end [s]."""
    made = _seen(one, vehicle, drive=drive, equipment="no IMU")
    moved = [
        Signal(n, s.time + late + grows * (s.time - s.time[0]) / np.ptp(s.time), s.values)
        for n in names
        if (s := made.drive.get(n)) is not None
    ]
    return made._replace(drive=made.drive.with_signals(*moved))


def _faulty(one: Subject, vehicle: Vehicle, *, case: Case) -> Made:
    drive, true = one.drives["drive"]
    assert one.base is not None
    assert one.limits is not None
    assert one.other is not None
    known_of = replace(one.base, tare=one.limits[0], gross=one.limits[1])
    damaged = fault_subjects.Subject(
        name=case.vehicle, vehicle=vehicle, drive=drive, mean=one.mean, final=true,
        known=tuple(d for d, _ in one.known), masses=tuple(m for _, m in one.known),
        known_of=known_of, other=one.other, undamaged={}, stds={}, warnings=frozenset(),
    )  # fmt: skip
    made = injected(case, damaged)
    with tempfile.TemporaryDirectory() as home:
        if through_files(case, made, Path(home) / "drive"):
            made = wb.read_drive(Path(home) / "drive")
    return Made(made, vehicle_of(case, damaged), true)


def _by_papers(one: Subject, _: Vehicle, *, drive: str, equipment: str) -> Made:
    assert one.papers is not None
    recorded, true = one.drives[drive]
    return Made(EQUIPMENT[equipment](recorded), one.papers, true)


def _uneven(
    one: Subject, vehicle: Vehicle, *, drive: str, white: float, wander: float, papers: bool
) -> Made:
    """Add noise to the heights: white, and wandering over 120 s [m]."""
    recorded, true = one.drives[drive]
    height = recorded.signals["altitude"]
    rng = np.random.default_rng(zlib.crc32(f"{recorded.name} {white} {wander}".encode()))
    step = rng.standard_normal(height.time.size)
    slow = np.zeros(height.time.size)
    keep = np.exp(-np.diff(height.time) / 120.0)
    slow[0] = step[0]
    for k, share in enumerate(keep, 1):
        slow[k] = share * slow[k - 1] + np.sqrt(1.0 - share**2) * step[k]
    noise = white * rng.standard_normal(height.time.size) + wander * slow
    seen = EQUIPMENT["no IMU"](recorded).with_signals(
        Signal("altitude", height.time, height.values + noise)
    )
    if papers:
        assert one.papers is not None
        vehicle = one.papers
    return Made(seen, vehicle, true)


HIGHER: Final = 1600.0
"""By how much a drive is lifted [m]."""


def _lifted(one: Subject, vehicle: Vehicle, *, power: float, air_flow: bool) -> Made:
    """Lift a drive: its load grows as its torque falls with a power of the charge (SAE J1979)."""
    drive, true = one.drives["drive"]
    ground, pressure = drive.signals["altitude"], drive.signals["barometric_pressure"]
    fall = float(np.median(standard_pressure(ground.values + HIGHER)))
    fall /= float(np.median(standard_pressure(ground.values)))
    load = drive.signals["engine_load"]
    seen = np.round(np.clip(load.values / fall**power, 0.0, 1.0) * 255.0) / 255.0
    there = drive.with_signals(
        Signal("altitude", ground.time, ground.values + HIGHER),
        Signal("barometric_pressure", pressure.time, pressure.values * fall),
        Signal("engine_load", load.time, seen),
    )
    return Made(there if air_flow else there.without("mass_air_flow"), vehicle, true)


def _altered(
    one: Subject,
    vehicle: Vehicle,
    *,
    drive: str,
    name: str,
    change: Callable[..., np.ndarray],
    without: tuple[str, ...] = (),
) -> Made:
    """Change a signal as a function of the part of the drive that is over, and of its values."""
    recorded, true = one.drives[drive]
    s = recorded.signals[name]
    over = (s.time - recorded.start) / recorded.duration
    seen = recorded.without(*without).with_signals(Signal(name, s.time, change(over, s.values)))
    return Made(seen, vehicle, true)


def _misread(
    one: Subject,
    vehicle: Vehicle,
    *,
    drive: str,
    equipment: str,
    change: Callable[[Drive], Drive],
) -> Made:
    """Change a drive as a wrong unit, sign or column does, then see it through an equipment."""
    recorded, true = one.drives[drive]
    return Made(seen_through(equipment, change(recorded)), vehicle, true)


def _times(drive: Drive, *, factors: dict[str, float]) -> Drive:
    """Multiply signals that are there."""
    found = [(s, factors[name]) for name in factors if (s := drive.get(name)) is not None]
    return drive.with_signals(*(Signal(s.name, s.time, f * s.values) for s, f in found))


def _unchanged(drive: Drive) -> Drive:
    return drive


def _held(drive: Drive, *, name: str) -> Drive:
    """Let a signal keep the value that it has in the middle of the drive."""
    s = drive.signals[name]
    return drive.with_signals(Signal(name, s.time, np.full(len(s), s.values[len(s) // 2])))


def _swapped(drive: Drive) -> Drive:
    lat, lon = drive.signals["latitude"], drive.signals["longitude"]
    return drive.with_signals(
        Signal("latitude", lat.time, lon.values), Signal("longitude", lon.time, lat.values)
    )


def _clock_times(drive: Drive, *, factor: float) -> Drive:
    """Let the table of the vehicle's bus count its time in another unit."""
    bus = [s for s in drive.signals.values() if s.name not in (*IMU, *GNSS)]
    return drive.with_signals(*(Signal(s.name, factor * s.time, s.values) for s in bus))


def _derived(drive: Drive) -> Drive:
    """Give the change of the speed as an accelerometer."""
    s = drive.signals["vehicle_speed"]
    rate = np.gradient(s.values, s.time)
    return drive.without(*IMU).with_signals(Signal("longitudinal_accel", s.time, rate))


CUT_OFF: Final = {"engine_load": 0.5, "engine_torque_fraction": 0.5, "engine_torque": 70.0}
"""A device of few bits gives no more than this of a reading [-], [N m]."""


def _cut_off(drive: Drive) -> Drive:
    """End the reading of the torque below what the engine gives."""
    found = [s for name in CUT_OFF if (s := drive.get(name)) is not None]
    return drive.with_signals(
        *(Signal(s.name, s.time, np.minimum(s.values, CUT_OFF[s.name])) for s in found)
    )


def _averaged(drive: Drive, *, span: float, names: tuple[str, ...] = IMU) -> Drive:
    """Average signals, those of the inertial sensor or others, over a span [s]."""
    kept = []
    for name in names:
        s = drive.signals[name]
        window = np.ones(max(1, round(span / s.period)))
        mean = np.convolve(s.values, window, "same") / np.convolve(np.ones(len(s)), window, "same")
        kept.append(Signal(name, s.time, mean))
    return drive.with_signals(*kept)


def _on_other_tyres(drive: Drive, *, scale: float, torque: str) -> Drive:
    """Turn wheels of another circumference: more of it, fewer turns and more torque."""
    turned = _times(drive, factors={"vehicle_speed": 1 / scale, "engine_speed": 1 / scale})
    s = turned.signals[torque]
    highest = float(np.max(s.values)) if torque == "engine_torque" else 1.0
    return turned.with_signals(Signal(torque, s.time, np.minimum(scale * s.values, highest)))


def _scaled(over: np.ndarray, x: np.ndarray, *, factor: float, since: float) -> np.ndarray:
    return np.where(over > since, factor * x, x)


def _bent(_: np.ndarray, x: np.ndarray, *, power: float) -> np.ndarray:
    top = float(np.max(np.abs(x)))
    return np.sign(x) * np.abs(x / top) ** power * top


def _recorded(_: Subject | None, __: Vehicle | None, *, drive: Path, vehicle: Path) -> Made:
    read = wb.read_drive(drive, mapping=vehicle.parent / "mapping.toml")
    return Made(read, Vehicle.load(vehicle), float("nan"))


# --- the list ------------------------------------------------------------------------------------


def _of_equipment() -> Iterator[Pair]:
    for of in (*MADE, *READ):
        truck = of == "foreign truck"
        names = ["drive"] if of.startswith("own") else ["ordinary", "motorway"]
        if of.startswith("foreign"):
            names = (
                [f"drive{k}" for k in range(5)] if truck else [f"drive-{k}" for k in (1, 2, 3, 4)]
            )
        origin = "foreign" if of.startswith("foreign") else "sound"
        heavy = " (truck)" if of.split()[-1] in ("truck", "semi", "electric_bus") else ""
        for equipment in OF_TRUCK if truck else EQUIPMENT:
            for name in names:
                make = partial(_seen, drive=name, equipment=equipment)
                yield Pair(
                    f"{of}/{name}/{equipment}", f"{origin}: {equipment}{heavy}", of, equipment,
                    make, sound=True,
                )  # fmt: skip


def _cuts() -> Iterator[Pair]:
    for of in MADE:
        names = ["drive"] if of.startswith("own") else ["ordinary", "motorway"]
        for name in names:
            for part in (0.1, 0.3, 0.5, 0.7, 0.9):
                for equipment in ("full", "no GNSS") if part in (0.3, 0.7) else ("full",):
                    make = partial(_cut, drive=name, part=part, equipment=equipment)
                    yield Pair(
                        f"{of}/{name} from {part:.0%}/{equipment}", f"cut of 300 s: {equipment}",
                        of, equipment, make, sound=True,
                    )  # fmt: skip


def _off_clocks() -> Iterator[Pair]:
    """Short drives in which the bus is seconds off the inertial sensor."""
    for of in ("own car", "own van", "own electric", "second petrol", "second van", "second truck"):
        name = "ordinary" if of.startswith("second") else "drive"
        for late in (-3.0, -1.0, 3.0):
            make = partial(_cut_off_clock, drive=name, part=0.3, late=late)
            yield Pair(
                f"{of}/{name} from 30%, bus {abs(late):g} s {'late' if late > 0.0 else 'early'}",
                "cut of 300 s: bus seconds off", of, "full", make, sound=False,
                reference=f"{of}/{name} from 30%/full",
            )  # fmt: skip


def _gnss_clocks() -> Iterator[Pair]:
    """Without an inertial sensor, GNSS or its heights on a clock of their own."""
    ways = (
        ("GNSS", 5.0, 0.0), ("GNSS", -12.0, 0.0), ("GNSS", 0.0, 6.0),
        ("heights", 4.0, 0.0), ("heights", -3.0, 0.0),
    )  # fmt: skip
    for of in MADE:
        for name in ("drive",) if of.startswith("own") else ("ordinary", "motorway"):
            for what, late, grows in ways:
                how = f"{late:+g} s" if late else f"drifts by {grows:g} s"
                names = GNSS if what == "GNSS" else ("altitude",)
                yield Pair(
                    f"{of}/{name}/{what} {how}, no IMU", f"fault: {what} off the clock, no IMU",
                    of, "no IMU",
                    partial(_off_clock, drive=name, names=names, late=late, grows=grows),
                    sound=False, reference=f"{of}/{name}/no IMU",
                )  # fmt: skip


def _faults() -> Iterator[Pair]:
    for case in (*all_cases(), *pairs_of_faults(PAIRED, 9470)):
        if case.vehicle == "long":
            continue
        of = f"own {case.vehicle}"
        sound = case.harmless and not any(f.stage == "calibration" for f, _ in case.faults)
        yield Pair(
            f"{of}/{case.damage}", f"fault: {case.group}", of, "full",
            partial(_faulty, case=case), sound=sound, reference=f"{of}/undamaged@0",
        )  # fmt: skip


def _heights() -> Iterator[Pair]:
    for of, names in (
        ("second truck", ("ordinary", "motorway")),
        ("second semi", ("ordinary", "motorway")),
    ):
        for name in names:
            yield from _papers(of, name, "data sheet: no IMU")
            for white, wander in ((0.4, 0.0), (0.0, 1.0), (0.4, 2.2)):
                for papers in (False, True):
                    way = "by data sheet" if papers else "calibrated"
                    yield Pair(
                        f"{of}/{name}/heights {white}+{wander} m/{way}",
                        f"noise of heights: {way}", of, "" if papers else "no IMU",
                        partial(_uneven, drive=name, white=white, wander=wander, papers=papers),
                        sound=True,
                    )  # fmt: skip
    for k in range(5):
        yield from _papers("foreign truck", f"drive{k}", "foreign: by data sheet")


def _papers(of: str, name: str, slice_: str) -> Iterator[Pair]:
    """A truck by data sheet alone, without an inertial sensor."""
    for rate in ("", ", OBD 1 Hz"):
        yield Pair(
            f"{of}/{name}/by data sheet{rate}", f"{slice_}{rate} (truck)", of, "",
            partial(_by_papers, drive=name, equipment=f"no IMU{rate}"), sound=True,
        )  # fmt: skip


def _recordings() -> Iterator[Pair]:
    """Recordings, whose mass nobody weighed: a change shows, an error does not."""
    home = SHARED / "data" / "bmw-i3"
    example = Path(__file__).parents[2] / "examples" / "bmw-i3"
    for path in sorted(home.glob("*.csv")):
        yield Pair(
            f"bmw-i3/{path.stem}", "recorded", "", "",
            partial(_recorded, drive=path, vehicle=example / "vehicle.toml"), sound=False,
        )  # fmt: skip


def _strangers() -> Iterator[Pair]:
    """Kinds of recordings that strangers made: thin air, a reading or a unit that changes."""
    for power in (0.0, 1.0):
        for air_flow in (False, True):
            seen = "with" if air_flow else "without"
            yield Pair(
                f"own car/{HIGHER:.0f} m higher, load by power {power:g}, {seen} air flow",
                "thin air", "own car", "full", partial(_lifted, power=power, air_flow=air_flow),
                sound=True,
            )  # fmt: skip
    torque = {"own van": "engine_torque_fraction", "own truck": "engine_torque_fraction",
              "second petrol": "engine_torque"}  # fmt: skip
    half, more = partial(_scaled, factor=0.8, since=0.5), partial(_scaled, factor=1.15, since=0.5)
    for of, name in torque.items():
        drives = ("ordinary", "motorway") if of.startswith("second") else ("drive",)
        for drive in drives:
            for words, change in (
                ("torque 0.8 times from the middle on", half),
                ("torque 1.15 times from the middle on", more),
                ("torque bent by a power of 1.2", partial(_bent, power=1.2)),
            ):
                make = partial(_altered, drive=drive, name=name, change=change)
                yield Pair(
                    f"{of}/{drive}/{words}", "fault: a reading that changes", of, "full", make,
                    sound=False, reference=f"{of}/{drive}/full",
                )  # fmt: skip
            slower = partial(_scaled, factor=1.0 / 1.609344, since=0.6)
            make = partial(_altered, drive=drive, name="vehicle_speed", change=slower, without=GNSS)
            yield Pair(
                f"{of}/{drive}/speed in mph from 60 % on, no GNSS", "fault: a reading that changes",
                of, "full", make, sound=False, reference=f"{of}/{drive}/full",
            )  # fmt: skip


TORQUE: Final = {
    "own car": "engine_load", "own truck": "engine_torque_fraction",
    "own electric": "engine_torque", "second petrol": "engine_torque",
}  # fmt: skip
"""Subjects whose signals are misread, and what their torque is read from."""

RECORDED_BY: Final = {
    "barometric_pressure": ("own car", "own truck", "own electric"),
    "retarder_torque": ("own truck",), "brake_switch": ("own truck",),
}  # fmt: skip
"""Signals that not all of them record."""

MILES: Final = 1.609344
FEET: Final = 0.3048


def _misreadings(of: str) -> Iterator[tuple[str, tuple[str, ...], Callable[[Drive], Drive]]]:
    """What is misread, the equipments it is seen through, and how."""
    torque = TORQUE[of]
    every_way = ("full", "no GNSS", "no IMU")
    lat_lon, accel, gyro = GNSS[:2], IMU[:3], IMU[3:]

    def times(names: tuple[str, ...], factor: float) -> Callable[[Drive], Drive]:
        return partial(_times, factors=dict.fromkeys(names, factor))

    for words, seen, names, factor in (
        ("mph taken for km/h", (*every_way, "speed alone"), ("vehicle_speed",), 1 / MILES),
        ("km/h taken for mph", (*every_way, "speed alone"), ("vehicle_speed",), MILES),
        ("m/s taken for km/h", (*every_way, "speed alone"), ("vehicle_speed",), 1 / 3.6),
        ("knots taken for m/s", ("full", "no IMU"), ("gnss_speed",), 1 / 0.514444),
        ("speed turned round", every_way, ("vehicle_speed",), -1.0),
        ("radians taken for degrees", ("full", "no IMU"), lat_lon, np.pi / 180.0),
        ("feet taken for metres", ("full", "no IMU", "one axis"), ("altitude",), 1 / FEET),
        ("metres taken for feet", ("full", "no IMU", "one axis"), ("altitude",), FEET),
        ("g taken for m/s2", ("full", "no GNSS"), accel, 1 / 9.80665),
        ("degrees taken for radians", ("full", "no GNSS"), gyro, 180.0 / np.pi),
        ("radians taken for degrees, gyro", ("full", "no GNSS"), gyro, np.pi / 180.0),
        ("revolutions a second taken for rpm", ("full", "no IMU"), ("engine_speed",), 1 / 60.0),
        ("parts of one taken for percent", ("full", "no IMU"), (torque,), 0.01),
        ("torque turned round", every_way, (torque,), -1.0),
        ("hPa taken for kPa", ("full", "no IMU"), ("barometric_pressure",), 10.0),
        ("kPa taken for hPa", ("full", "no IMU"), ("barometric_pressure",), 0.1),
        ("retarder turned round", ("full", "no IMU"), ("retarder_torque",), -1.0),
        ("brake switch dead", ("full", "no IMU"), ("brake_switch",), 0.0),
    ):  # fmt: skip
        if of in RECORDED_BY.get(names[0], TORQUE):
            yield words, seen, times(names, factor)
    if torque == "engine_torque":
        factor = 100.0 / {"own electric": 250.0, "second petrol": 190.0}[of]
        yield "percent taken for N m", ("full", "no IMU"), times((torque,), factor)
    yield "latitude and longitude swapped", ("full", "no IMU"), _swapped
    for name, seen in (
        ("vehicle_speed", ("full", "no GNSS")), (torque, ("full", "no IMU")),
        ("engine_speed", ("full", "no IMU")), ("altitude", ("full", "no IMU")),
        ("gyro_z", ("full", "no GNSS")), ("accel_x", ("full", "no GNSS")),
        ("latitude", ("full", "no IMU")),
    ):  # fmt: skip
        yield f"{name} never changes", seen, partial(_held, name=name)
    for words, factor in (("milliseconds", 1000.0), ("minutes", 1.0 / 60.0)):
        yield (
            f"time of the bus in {words}",
            ("full", "no GNSS"),
            partial(_clock_times, factor=factor),
        )
    yield "change of the speed as accelerometer", ("calculated axis",), _unchanged
    for span in (1.0, 3.0):
        seen = ("full", "no GNSS")
        yield f"inertial sensor averaged over {span:g} s", seen, partial(_averaged, span=span)
    averaged = partial(_averaged, span=6.0, names=(torque,))
    yield "torque averaged over 6 s", ("full", "no IMU"), averaged
    for scale in (0.96, 1.04):
        way = partial(_on_other_tyres, scale=scale, torque=torque)
        yield f"tyres of {scale:.0%} of the circumference", ("full", "no IMU"), way


def _misread_pairs() -> Iterator[Pair]:
    for of in TORQUE:
        name = "ordinary" if of.startswith("second") else "drive"
        for words, seen, change in _misreadings(of):
            for equipment in seen:
                made_by = CALIBRATED_BY.get(equipment, equipment)
                yield Pair(
                    f"{of}/{name}/{words}/{equipment}", "fault: misread", of, made_by,
                    partial(_misread, drive=name, equipment=equipment, change=change),
                    sound=False, reference=f"{of}/{name}/{made_by}",
                )  # fmt: skip


def _in_feet() -> Iterator[Pair]:
    """Heights in feet of vehicles that are not misread otherwise, on hillier roads."""
    change = partial(_times, factors={"altitude": 1.0 / FEET})
    for of, name in (
        ("foreign wagon", "drive-1"), ("foreign hatchback", "drive-1"),
        ("foreign truck", "drive0"), ("second van", "motorway"), ("second semi", "ordinary"),
        ("second semi", "motorway"),
    ):  # fmt: skip
        for equipment in ("full", "no IMU"):
            yield Pair(
                f"{of}/{name}/feet taken for metres/{equipment}", "fault: misread", of, equipment,
                partial(_misread, drive=name, equipment=equipment, change=change),
                sound=False, reference=f"{of}/{name}/{equipment}",
            )  # fmt: skip


def _cut_offs() -> Iterator[Pair]:
    """A device that cuts the torque off in all drives, those of the calibration too."""
    for of in ("own car", "own electric", "second petrol", "second van", "second truck"):
        for name in ("drive",) if of.startswith("own") else ("ordinary", "motorway"):
            for equipment in ("torque cut off", "no IMU, torque cut off"):
                yield Pair(
                    f"{of}/{name}/{equipment}", f"device: {equipment}", of, equipment,
                    partial(_seen, drive=name, equipment=equipment), sound=False,
                )  # fmt: skip


def _other_sensors() -> Iterator[Pair]:
    """Calibrated with an inertial sensor and weighed without, and the other way round; without a
    gyroscope.
    """
    for of in MADE:
        name = "drive" if of.startswith("own") else "ordinary"
        heavy = " (truck)" if of.split()[-1] in ("truck", "semi", "electric_bus") else ""
        for made_by, seen, slice in (
            ("full", "no IMU", "calibrated with an IMU, weighed without"),
            ("no IMU", "full", "calibrated without an IMU, weighed with"),
            ("accelerometer alone", "accelerometer alone", "accelerometer alone"),
        ):
            yield Pair(
                f"{of}/{name}/{slice}", f"sound: {slice}{heavy}", of, made_by,
                partial(_seen, drive=name, equipment=seen), sound=True,
            )  # fmt: skip


def _other_rates() -> Iterator[Pair]:
    """Trucks without inertial sensor whose torque came at another rate in the calibration."""
    slow, fast = "no IMU, OBD 1 Hz", "no IMU"
    drives = [("own truck", "drive"), ("foreign truck", "drive0"), ("foreign truck", "drive3")]
    for of in ("second truck", "second semi"):
        drives += [(of, "ordinary"), (of, "motorway")]
    for of, name in drives:
        for made_by, seen, slice in (
            (fast, slow, "calibrated fast, weighed at 1 Hz"),
            (slow, fast, "calibrated at 1 Hz, weighed fast"),
        ):
            yield Pair(
                f"{of}/{name}/{slice}", f"sound: {slice} (truck)", of, made_by,
                partial(_seen, drive=name, equipment=seen), sound=True,
            )  # fmt: skip


def _gearboxes() -> Iterator[Pair]:
    """Vehicles by their gearbox; a hybrid, whose motor helps, is refused or reported."""
    for of in MADE_BY_GEARBOX:
        hybrid = "hybrid" in of or "split" in of
        kind = "hybrid, " if hybrid else ""
        for name in ("ordinary", "motorway"):
            for equipment in ("full", "IMU 50 Hz, OBD 1 Hz", "no IMU"):
                yield Pair(
                    f"{of}/{name}/{equipment}", f"gearbox: {kind}{equipment}", of, equipment,
                    partial(_seen, drive=name, equipment=equipment), sound=not hybrid,
                )  # fmt: skip


def all_pairs() -> list[Pair]:
    """List all pairs, in an order that stays."""
    return [
        *_of_equipment(), *_cuts(), *_off_clocks(), *_gnss_clocks(), *_faults(), *_heights(),
        *_recordings(),
        *_strangers(),
        *_misread_pairs(), *_in_feet(), *_other_sensors(), *_other_rates(),
        *_gearboxes(), *_cut_offs(),
    ]  # fmt: skip


OF_CI: Final = ("own car", "own electric")
SEEN_IN_CI: Final = ("full", "no IMU")
FOREIGN_IN_CI: Final = "foreign: full"
"""Subjects and equipment of the part that CI weighs: few, for each has to be made."""


def part(name: str) -> list[Pair]:
    """Return the pairs of a part: ``all``, ``ci`` (150) or ``quick`` (30), and their references.

    Of the 150, eight are drives of another simulator, where its data are.
    """
    pairs = all_pairs()
    if name == "all":
        return pairs
    there = [p for p in pairs if p.of in OF_CI and p.equipment in SEEN_IN_CI]
    if name == "quick":
        there = [p for p in there if p.of == OF_CI[0] and p.equipment == "full"]
    order = sorted(there, key=lambda p: zlib.crc32(p.id.encode()))
    chosen = order[:30]
    if name == "ci":
        foreign = [p for p in pairs if p.slice == FOREIGN_IN_CI and not unavailable(p)]
        chosen = foreign + order[: 150 - len(foreign)]
    wanted = {p.id for p in chosen} | {p.reference for p in chosen}
    return [p for p in pairs if p.id in wanted]


def unavailable(pair: Pair) -> str:
    """Say why a pair cannot be made here; empty where it can."""
    return absent(pair.of) if pair.of else ""
