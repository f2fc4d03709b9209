"""What a vehicle file says, in words."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from weighbridge.constants import (
    CRUISE,
    GAS_CONSTANT_DRY_AIR,
    GRAVITY,
    STANDARD_PRESSURE,
    STANDARD_TEMPERATURE,
)
from weighbridge.signals import scalar_from_si
from weighbridge.vehicle.data_sheet import (
    by_data_sheet,
    needs_calibration,
    scale_std,
    wheel_efficiency,
)
from weighbridge.vehicle.model import Vehicle
from weighbridge.vehicle.road import Origin, Value
from weighbridge.vehicle.torque import source_of, torque_of

_MOTIONS: Final = {
    "inertial": "inertial sensor with speed or GNSS",
    "longitudinal_accel": "a longitudinal accelerometer and speed",
    "speed_grade": "speed and height or grade, no accelerometer",
    "speed": "speed alone, no grade",
}


_FEWEST_RELIABLE: Final = 2
"""Calibration drives from which a file is reported as good as in the table of docs/accuracy.md."""


def tell(vehicle: Vehicle) -> list[tuple[str, str]]:
    """Say what a vehicle file holds: pairs of a heading and a sentence."""
    said = [("vehicle", _masses(vehicle)), ("gears", _gears(vehicle))]
    said.append(("torque", _torque(vehicle)))
    said.append(("road", _road(vehicle)))
    if vehicle.mounting is not None:
        said.append(("sensor", _mounting(vehicle)))
    if vehicle.timing.torque_delay is not None:
        said.append(("timing", _timing(vehicle)))
    if vehicle.mapping is not None:
        said.append(("mapping", f"drives are read by {vehicle.mapping}, unless --mapping is given"))
    said.append(("made", _made(vehicle)))
    said.append(("worth", worth(vehicle)))
    if vehicle.without_accelerometer is not None:
        said.append(("no sensor", f"without an accelerometer {worth(vehicle.by_speed())}"))
    if vehicle.provenance.notes:
        said.append(("notes", vehicle.provenance.notes))
    return said


def can_weigh(vehicle: Vehicle) -> bool:
    """Whether a drive can be weighed with it: it says what the torque is worth.

    A reported torque needs no gears in the file: engine and vehicle speed show them.
    """
    if vehicle.provenance.torque_fitted or vehicle.provenance.fit is not None:
        return True
    if needs_calibration(vehicle):
        return False
    if vehicle.torque.source is not None and by_data_sheet(vehicle):
        return True
    geared = bool(vehicle.driveline.gearings) or source_of(vehicle).gearing is not None
    return geared and (vehicle.torque.stated or by_data_sheet(vehicle))


def worth(vehicle: Vehicle) -> str:
    """Say how sure a mass weighed with it can be."""
    scale = vehicle.provenance.mass_scale_std
    if not can_weigh(vehicle):
        return "cannot weigh yet: calibrate it on a drive of known mass"
    if scale is None:
        return (
            "weighs by data sheet, never calibrated: a standard deviation of "
            f"{100.0 * scale_std(vehicle):.1f} % of any mass for torque, efficiency and rolling "
            "radius, and 3 % more where the sensor's lean is not known"
        )
    if not vehicle.provenance.drives and not vehicle.provenance.masses:
        return (
            "weighs by what the file states, never calibrated: a standard "
            f"deviation of {100.0 * scale:.1f} % of any mass (mass_scale_std)"
        )
    text = f"the calibration leaves a standard deviation of {100.0 * scale:.1f} % of any mass"
    if len(vehicle.provenance.drives) < _FEWEST_RELIABLE:
        text += "; one drive made it: two more, of other masses, would make it better"
    return text


def _masses(vehicle: Vehicle) -> str:
    parts = [f"{vehicle.kind} {vehicle.name!r}"]
    if vehicle.engine is not None:
        parts.append(f"{vehicle.engine} {'motor' if vehicle.engine == 'electric' else 'engine'}")
    parts.append(
        f"tare {vehicle.tare:.0f} kg"
        if vehicle.tare is not None
        else "tare unknown, so no payload is shown"
    )
    if vehicle.gross is not None:
        parts.append(f"permitted mass {vehicle.gross:.0f} kg")
    return ", ".join(parts)


def _gears(vehicle: Vehicle) -> str:
    line = vehicle.driveline
    if source_of(vehicle).gearing is not None:
        return "not needed: what is read does not depend on them"
    if line.gearing_range is not None:
        low, high = (scalar_from_si(g * CRUISE, "rpm") for g in line.gearing_range)
        return f"stepless, {low:.0f} to {high:.0f} rpm at 100 km/h; measured at each instant"
    if not line.gearings:
        return "not known; a calibration finds them from engine and vehicle speed"
    last = line.gearings[-1] * CRUISE
    speed = f"{scalar_from_si(last, 'rpm'):.0f} rpm at 100 km/h"
    if line.single_speed:
        return f"one gear, {speed}"
    ratios = ", ".join(f"{g / line.gearings[-1]:.2f}" for g in line.gearings)
    return f"{len(line.gearings)} gears, {speed} in the last; over the last: {ratios}"


def _torque(vehicle: Vehicle) -> str:
    model = vehicle.torque
    if needs_calibration(vehicle):
        return f"by {source_of(vehicle).title}; a calibration finds what that is worth"
    if not can_weigh(vehicle):
        return "nothing is known of it; a calibration finds what the reading is worth"
    source = source_of(vehicle)
    text = f"from {source.words}"
    if source.axis_suffix == "pct" and model.speed_range and model.load_range:
        low, high = model.speed_range
        turning = np.linspace(low, high, 60)
        most = model.load_range[1]
        torque = torque_of(model, np.full(60, most), turning)
        k = int(np.argmax(torque))
        text += (
            f"; at {100.0 * most:.0f} % load, the highest the calibration saw, up to "
            f"{torque[k]:.0f} N m at {scalar_from_si(float(turning[k]), 'rpm'):.0f} rpm"
        )
    if model.reference_torque is not None:
        text += f"; 100 % is {model.reference_torque:.0f} N m"
    if by_data_sheet(vehicle):
        text += f"; the driveline passes on {100.0 * wheel_efficiency(vehicle):.0f} %"
    if model.noise is not None:
        text += f"; noise {model.noise:.1f} N m"
    return text


def _with_std(known: Value, digits: int) -> str:
    text = f"{known.value:.{digits}f}" + (f" (std {known.std:.{digits}f})" if known.std else "")
    return f"{text} (usual for its class)" if known.origin is Origin.CLASS else text


def _road(vehicle: Vehicle) -> str:
    drag_area, rolling = vehicle.road.drag_area, vehicle.road.rolling_coefficient
    density = STANDARD_PRESSURE / (GAS_CONSTANT_DRY_AIR * STANDARD_TEMPERATURE)
    drag = 0.5 * density * drag_area.value * CRUISE**2
    text = f"C_d A {_with_std(drag_area, 2)} m², C_r {_with_std(rolling, 4)}"
    if vehicle.tare is not None:
        force = drag + rolling.value * vehicle.tare * GRAVITY
        text += f"; empty at 100 km/h on the flat {force * CRUISE / 1000.0:.0f} kW"
    return text


def _mounting(vehicle: Vehicle) -> str:
    m = vehicle.mounting
    assert m is not None
    roll, pitch, yaw = (scalar_from_si(x, "deg") for x in (m.roll, m.pitch, m.yaw))
    text = f"turned by roll {roll:.1f}°, pitch {pitch:.1f}°, yaw {yaw:.1f}°"
    if m.squat is not None:
        text += f"; the nose lifts {scalar_from_si(m.squat, 'deg'):.2f}° per m/s²"
    return text


def _timing(vehicle: Vehicle) -> str:
    t = vehicle.timing
    assert t.torque_delay is not None
    side = "late" if t.torque_delay >= 0.0 else "early"
    text = f"the torque is stamped {abs(t.torque_delay):.2f} s {side}"
    return text + (f" and smoothed over {t.torque_lag:.2f} s" if t.torque_lag else "")


def _made(vehicle: Vehicle) -> str:
    p = vehicle.provenance
    if not p.drives and not p.masses:
        return "from what is known of the vehicle; never calibrated"
    masses = ", ".join(f"{mass:.0f}" for mass in p.masses)
    when = f" on {p.date}" if p.date else ""
    text = f"calibrated{when} for {p.method or 'rls'} by {', '.join(p.drives)} ({masses} kg)"
    if p.motion is not None:
        text += f"; motion from {_MOTIONS.get(p.motion, p.motion)}"
    if p.r_squared is not None and math.isfinite(p.r_squared):
        text += f"; R² of the torque {p.r_squared:.3f}"
    return text
