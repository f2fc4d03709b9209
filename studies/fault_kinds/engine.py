"""Speed and torque of the engine, speed of the wheels, and who else is in the log."""

from __future__ import annotations

import numpy as np
from scipy import signal as dsp

from fault_kinds.shaping import (
    Fault,
    changed,
    inside,
    middle,
    of_table,
    ramped,
    scaled,
    stretches,
    torque_of,
)
from weighbridge.signals import Drive, Floats, Signal
from weighbridge.vehicle.model import Vehicle

SPEED = "speed of the engine"
SPEED_WORDS = r"engine.speed|gearings?\b|gears change|another vehicle|two vehicles"
TORQUE = "load and torque"
TORQUE_WORDS = (
    r"engine_load|engine_torque|reference_torque|reference torque"
    r"|(the|its|high) torques? (or load )?(of|reads?|runs|shows)|load or torque"
    r"|torque,? (or )?load\b|engine reads"
)
UNITS = "speed and units"
UNITS_WORDS = (
    r"(?<!engine_)(?<!engine )\bvehicle.speed\b|\bspeed from|jumps? of the speed|\bmph\b|miles"
    r"|speed's (unit|scale)|\btyres\b|rolls? .* around|the two speeds|\bboth speeds|steady ratios"
)
WHOLE = "another vehicle, impossible values"
SPLICE_WORDS = "recordings seem to be joined"
WHOLE_WORDS = r"another vehicle|two vehicles|gears (change|of)|\bgearings?\b|different drives"
ACCEL_WORDS = r"accel_x .*outside|values of accel_x|samples of accel_x|inertial samples are"

Rng = np.random.Generator


def engine_speed_scale(drive: Drive, severity: float, rng: Rng) -> Drive:
    """Engine speed is multiplied by this [-]."""
    return scaled(drive, ["engine_speed"], severity)


def engine_speed_scale_from_middle(drive: Drive, severity: float, rng: Rng) -> Drive:
    """Engine speed is multiplied by this from the middle on [-]."""
    return scaled(drive, ["engine_speed"], severity, middle(drive))


def engine_speed_dropouts(drive: Drive, severity: float, rng: Rng) -> Drive:
    """A share of the values of engine speed is zero [-]."""
    return changed(
        drive, ["engine_speed"], lambda t, x: np.where(rng.random(x.size) < severity, 0.0, x)
    )


def torque_scale(drive: Drive, severity: float, rng: Rng) -> Drive:
    """Load is multiplied by this all the drive; air flow in the same log is not [-]."""
    return scaled(drive, [torque_of(drive)], severity)


def torque_scale_from_middle(drive: Drive, severity: float, rng: Rng) -> Drive:
    """Load or torque is multiplied by this from the middle on [-]."""
    return scaled(drive, [torque_of(drive)], severity, middle(drive))


def torque_scale_ramps(drive: Drive, severity: float, rng: Rng) -> Drive:
    """The scale of load or torque goes from one to this over the drive [-]."""
    return ramped(drive, [torque_of(drive)], severity)


def torque_clipped(drive: Drive, severity: float, rng: Rng) -> Drive:
    """Load or torque ends at this part of its highest [-]."""

    def clip(t: Floats, x: Floats) -> Floats:
        return np.minimum(x, severity * np.max(x))

    return changed(drive, [torque_of(drive)], clip)


def torque_renewed(drive: Drive, severity: float, rng: Rng) -> Drive:
    """Load or torque is renewed at this rate, and repeated between [Hz]."""

    def hold(t: Floats, x: Floats) -> Floats:
        slot = np.floor((t - t[0]) * severity)
        return x[np.searchsorted(slot, slot)]

    return changed(drive, [torque_of(drive)], hold)


def torque_absolute(drive: Drive, severity: float, rng: Rng) -> Drive:
    """The sign of torque is lost."""
    return changed(drive, [torque_of(drive)], lambda t, x: np.abs(x))


def torque_never_below(drive: Drive, severity: float, rng: Rng) -> Drive:
    """Torque never goes below this part of its highest [-]."""
    return changed(drive, [torque_of(drive)], lambda t, x: np.maximum(x, severity * np.max(x)))


def torque_negated(drive: Drive, severity: float, rng: Rng) -> Drive:
    """The sign of torque is turned."""
    return changed(drive, [torque_of(drive)], lambda t, x: -x)


def torque_drops_to_zero(drive: Drive, severity: float, rng: Rng) -> Drive:
    """A share of the values of load or torque is zero [-]."""
    return changed(
        drive, [torque_of(drive)], lambda t, x: np.where(rng.random(x.size) < severity, 0.0, x)
    )


def torque_drops_in_runs(drive: Drive, severity: float, rng: Rng) -> Drive:
    """Load or torque is zero for 5 s at a time, for a share of the drive [-]."""
    starts, ends = stretches(drive, severity, 5.0, rng)
    return changed(
        drive, [torque_of(drive)], lambda t, x: np.where(inside(t, starts, ends), 0.0, x)
    )


def torque_at_full_scale(drive: Drive, severity: float, rng: Rng) -> Drive:
    """A share of the values of load or torque is its highest [-]."""
    return changed(
        drive,
        [torque_of(drive)],
        lambda t, x: np.where(rng.random(x.size) < severity, np.max(x), x),
    )


def torque_steps(drive: Drive, severity: float, rng: Rng) -> Drive:
    """Load or torque is rounded to steps of this part of its highest [-]."""

    def coarse(t: Floats, x: Floats) -> Floats:
        step = severity * np.max(x)
        return np.round(x / step) * step

    return changed(drive, [torque_of(drive)], coarse)


def torque_offset_from_middle(drive: Drive, severity: float, rng: Rng) -> Drive:
    """Load or torque reads more from the middle on, by a part of its highest [-]."""
    at = middle(drive)
    return changed(drive, [torque_of(drive)], lambda t, x: x + severity * np.max(x) * (t >= at))


def torque_smoothed(drive: Drive, severity: float, rng: Rng) -> Drive:
    """Load or torque is low-passed with this time constant [s]."""

    def smooth(t: Floats, x: Floats) -> Floats:
        c = float(np.exp(-np.median(np.diff(t)) / severity))
        made, _ = dsp.lfilter([1.0 - c], [1.0, -c], x, zi=[c * x[0]])
        return np.asarray(made)

    return changed(drive, [torque_of(drive)], smooth)


def torque_unit_changes(drive: Drive, severity: float, rng: Rng) -> Drive:
    """Torque goes over to pound-feet in the middle [-]."""
    return scaled(drive, [torque_of(drive)], severity, middle(drive))


def reference_torque_changes(drive: Drive, severity: float, rng: Rng) -> Drive:
    """The reference torque is multiplied by this from the middle on [-]."""
    return scaled(drive, ["reference_torque"], severity, middle(drive))


def _without_fixes(drive: Drive) -> Drive:
    return drive.without(*of_table(drive, "gnss"))


def speed_unit_changes(drive: Drive, severity: float, rng: Rng) -> Drive:
    """Speed goes over to another unit in the middle [-]."""
    return scaled(drive, ["vehicle_speed"], severity, middle(drive))


def speed_unit_changes_without_fixes(drive: Drive, severity: float, rng: Rng) -> Drive:
    """Speed goes over to another unit in the middle, and there is no GNSS [-]."""
    return scaled(_without_fixes(drive), ["vehicle_speed"], severity, middle(drive))


def speed_scale(drive: Drive, severity: float, rng: Rng) -> Drive:
    """Speed of the wheels is multiplied by this [-]."""
    return scaled(drive, ["vehicle_speed"], severity)


def speed_dropouts(drive: Drive, severity: float, rng: Rng) -> Drive:
    """A share of the values of speed is zero [-]."""
    return changed(
        drive, ["vehicle_speed"], lambda t, x: np.where(rng.random(x.size) < severity, 0.0, x)
    )


def speed_steps(drive: Drive, severity: float, rng: Rng) -> Drive:
    """Speed is rounded to steps of this [km/h]."""
    step = severity / 3.6
    return changed(drive, ["vehicle_speed"], lambda t, x: np.round(x / step) * step)


def followed_by_another(drive: Drive, severity: float, rng: Rng, other: Drive) -> Drive:
    """From a part of the drive on the log is another vehicle's [-]."""
    at = middle(drive, severity)
    made = []
    for s in drive.signals.values():
        second = other.get(s.name)
        early = s.time < at
        if second is None:
            made.append(Signal(s.name, s.time[early], s.values[early]))
            continue
        late = second.time >= at
        made.append(
            Signal(
                s.name,
                np.concatenate((s.time[early], second.time[late])),
                np.concatenate((s.values[early], second.values[late])),
            )
        )
    return drive.with_signals(*(s for s in made if len(s)))


def bus_of_another(drive: Drive, severity: float, rng: Rng, other: Drive) -> Drive:
    """All that comes from the bus is another vehicle's of the same kind, later by this [s]."""
    moved = [
        Signal(s.name, s.time + severity, s.values)
        for name in of_table(drive, "obd")
        if (s := other.get(name)) is not None
    ]
    return drive.with_signals(*moved)


def accel_out_of_range(drive: Drive, severity: float, rng: Rng) -> Drive:
    """A share of the rows of the accelerometer holds 500 m/s^2 [-]."""
    return changed(
        drive, ["accel_x"], lambda t, x: np.where(rng.random(x.size) < severity, 500.0, x)
    )


def engine_speed_out_of_range(drive: Drive, severity: float, rng: Rng) -> Drive:
    """A share of the values of engine speed is 65535 rpm [-]."""
    return changed(
        drive, ["engine_speed"], lambda t, x: np.where(rng.random(x.size) < severity, 6862.8, x)
    )


def speed_out_of_range(drive: Drive, severity: float, rng: Rng) -> Drive:
    """A share of the values of speed is 655 km/h [-]."""
    return changed(
        drive, ["vehicle_speed"], lambda t, x: np.where(rng.random(x.size) < severity, 182.0, x)
    )


def torque_out_of_range(drive: Drive, severity: float, rng: Rng) -> Drive:
    """A share of the values of load or torque is far above what there is [-]."""
    return changed(
        drive,
        [torque_of(drive)],
        lambda t, x: np.where(rng.random(x.size) < severity, 50.0 * np.max(x), x),
    )


def tare_above_mass(vehicle: Vehicle, mass: float, severity: float) -> float:
    """The vehicle file's tare is above the mass, so that the payload is negative [kg]."""
    return mass + severity


LOAD = ("car",)
FAULTS = (
    Fault(SPEED, engine_speed_scale, (0.5, 0.8, 0.95, 1.05, 1.2, 1.41, 2.0), SPEED_WORDS),
    Fault(SPEED, engine_speed_scale, (1.41, 2.0), SPEED_WORDS, ("truck",)),
    Fault(SPEED, engine_speed_scale_from_middle, (0.5, 1.2, 2.0), SPEED_WORDS),
    Fault(SPEED, engine_speed_dropouts, (0.03, 0.2), SPEED_WORDS),
    # Without a second witness a constant scale is a heavier vehicle: only the car has one.
    Fault(TORQUE, torque_scale, (0.7, 0.8, 0.9, 1.1, 1.25), TORQUE_WORDS, LOAD),
    Fault(TORQUE, torque_scale_from_middle, (0.7, 0.8, 0.9, 1.2), TORQUE_WORDS),
    Fault(TORQUE, torque_scale_from_middle, (0.8,), TORQUE_WORDS, ("truck", "long")),
    Fault(TORQUE, torque_scale_ramps, (0.6, 0.8, 1.2), TORQUE_WORDS),
    Fault(TORQUE, torque_clipped, (0.4, 0.6, 0.8), TORQUE_WORDS),
    Fault(TORQUE, torque_renewed, (1.0, 0.5), TORQUE_WORDS),
    Fault(TORQUE, torque_absolute, (1,), TORQUE_WORDS, ("electric",)),
    Fault(TORQUE, torque_never_below, (0.0, 0.1), TORQUE_WORDS, ("electric", "van", "car")),
    Fault(TORQUE, torque_negated, (1,), TORQUE_WORDS, ("electric",)),
    Fault(TORQUE, torque_drops_to_zero, (0.01, 0.03, 0.1), TORQUE_WORDS),
    Fault(TORQUE, torque_drops_in_runs, (0.03, 0.1), TORQUE_WORDS),
    Fault(TORQUE, torque_at_full_scale, (0.01, 0.03, 0.1), TORQUE_WORDS),
    Fault(TORQUE, torque_steps, (0.02, 0.05, 0.1), TORQUE_WORDS),
    Fault(TORQUE, torque_offset_from_middle, (0.05, 0.15), TORQUE_WORDS),
    Fault(TORQUE, torque_smoothed, (1.0, 3.0), TORQUE_WORDS),
    Fault(TORQUE, torque_unit_changes, (0.7376,), TORQUE_WORDS, ("electric",)),
    Fault(TORQUE, reference_torque_changes, (0.5, 0.8, 1.3), TORQUE_WORDS, ("van", "truck")),
    Fault(UNITS, speed_unit_changes, (0.6214, 1.609), UNITS_WORDS),
    Fault(UNITS, speed_unit_changes_without_fixes, (0.6214, 0.2778), UNITS_WORDS),
    Fault(UNITS, speed_scale, (0.6214, 0.9, 1.05, 1.1), UNITS_WORDS),
    Fault(UNITS, speed_dropouts, (0.01, 0.1), UNITS_WORDS),
    Fault(UNITS, speed_steps, (5, 20), UNITS_WORDS),
    Fault(
        WHOLE,
        followed_by_another,
        (0.3, 0.5, 0.8),
        f"{WHOLE_WORDS}|{SPLICE_WORDS}",
        stage="splice",
    ),
    Fault(WHOLE, bus_of_another, (0.0,), WHOLE_WORDS + "|clock|apart", stage="splice"),
    Fault(WHOLE, accel_out_of_range, (1e-5, 0.001, 0.05), ACCEL_WORDS),
    Fault(WHOLE, engine_speed_out_of_range, (0.001, 0.05), SPEED_WORDS),
    Fault(WHOLE, speed_out_of_range, (0.001, 0.05), UNITS_WORDS),
    Fault(WHOLE, torque_out_of_range, (0.001, 0.05), TORQUE_WORDS),
    Fault(
        WHOLE, tare_above_mass, (273, 600), r"less than zero|less than the tare",
        stage="vehicle", must_tell=True,
    ),
)  # fmt: skip
