"""The quantities a drive can hold: names, units, tables and plausible ranges."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True, slots=True)
class Quantity:
    """One quantity of the canonical drive format.

    Attributes
    ----------
    name : name inside the program
    table : canonical table it is stored in
    stem : column name without its unit suffix
    suffix : canonical unit suffix; empty for switches and counts
    low, high : plausible range of a road vehicle [SI]
    meaning : what it is, for people
    """

    name: str
    table: str
    stem: str
    suffix: str
    low: float
    high: float
    meaning: str

    @property
    def column(self) -> str:
        """Canonical column name with its unit suffix."""
        return f"{self.stem}_{self.suffix}" if self.suffix else self.stem


_C = 273.15
"""0 °C [K]."""
_WHEELS = {"fl": "front left", "fr": "front right", "rl": "rear left", "rr": "rear right"}

_ROWS: Final = (
    *(
        Quantity(f"accel_{a}", "imu", f"accel_{a}", "mps2", -80.0, 80.0, f"specific force, sensor {a}")
        for a in "xyz"
    ),
    *(
        Quantity(f"gyro_{a}", "imu", f"gyro_{a}", "radps", -9.0, 9.0, f"angular rate, sensor {a}")
        for a in "xyz"
    ),
    Quantity("longitudinal_accel", "obd", "longitudinal_accel", "mps2", -25.0, 25.0,
             "specific force along the vehicle, positive forward"),
    Quantity("vehicle_speed", "obd", "vehicle_speed", "kmh", -8.0, 95.0, "speed from the wheels"),
    Quantity("engine_speed", "obd", "engine_speed", "rpm", -50.0, 2600.0, "speed of engine or motor"),
    Quantity("engine_load", "obd", "engine_load", "pct", 0.0, 1.02, "calculated load (PID 04)"),
    Quantity("engine_torque", "obd", "engine_torque", "nm", -4000.0, 6000.0,
             "torque at the shaft of engine or motor"),
    Quantity("engine_torque_fraction", "obd", "engine_torque", "pct", -1.3, 1.3,
             "torque as a part of the reference torque (PID 62, SPN 513)"),
    Quantity("indicated_torque_fraction", "obd", "indicated_torque", "pct", -1.3, 1.3,
             "torque of combustion, friction included (SPN 513 without SPN 514)"),
    Quantity("reference_torque", "obd", "reference_torque", "nm", 10.0, 6000.0,
             "reference torque (PID 63, SPN 544)"),
    Quantity("engine_power", "obd", "engine_power", "kw", -2e6, 2e6,
             "power at the shaft of engine or motor, negative while it brakes"),
    Quantity("wheel_torque", "obd", "wheel_torque", "nm", -1e5, 1e5,
             "torque of the driveline at all driven wheels together"),
    *(
        Quantity(f"wheel_torque_{axle}", "obd", f"wheel_torque_{axle}", "nm", -1e5, 1e5,
                 f"torque of the driveline at both wheels of the {axle} axle")
        for axle in ("front", "rear")
    ),
    *(
        Quantity(f"wheel_torque_{w}", "obd", f"wheel_torque_{w}", "nm", -1e5, 1e5,
                 f"torque of the driveline at the wheel {where}")
        for w, where in _WHEELS.items()
    ),
    Quantity("traction_force", "obd", "traction_force", "n", -2e5, 2e5,
             "force of the driveline at the wheels, positive forward"),
    Quantity("mass_air_flow", "obd", "mass_air_flow", "gps", 0.0, 1.5, "intake air mass flow (PID 10)"),
    Quantity("lambda_1", "obd", "lambda_1", "", 0.4, 20.0, "air-fuel equivalence ratio"),
    Quantity("throttle", "obd", "throttle", "pct", -0.02, 1.02, "throttle or accelerator position"),
    Quantity("intake_pressure", "obd", "intake_pressure", "kpa", 0.0, 5e5, "intake manifold pressure"),
    Quantity("ambient_temperature", "obd", "ambient_temperature", "degc", _C - 50, _C + 65,
             "ambient air temperature"),
    Quantity("barometric_pressure", "obd", "barometric_pressure", "kpa", 4.5e4, 1.12e5,
             "barometric pressure"),
    Quantity("gear", "obd", "gear", "", -3.0, 18.0, "current gear; 0 neutral, negative reverse"),
    Quantity("gear_ratio", "obd", "gear_ratio", "", 0.0, 66.0,
             "ratio of the gear engaged, as the transmission reports it (PID A4)"),
    Quantity("absolute_load", "obd", "absolute_load", "pct", 0.0, 257.0,
             "air per stroke over that of full displacement (PID 43)"),
    Quantity("demanded_torque", "obd", "demanded_torque", "pct", -1.3, 1.3,
             "torque the driver asks for, as a part of the reference torque (PID 61)"),
    *(
        Quantity(f"torque_point_{k}", "obd", f"torque_point_{k}", "pct", -1.3, 1.3,
                 f"torque as a part of the reference torque, {where} (PID 64)")
        for k, where in enumerate(("at idle", *(f"at point {p} of the engine map" for p in range(1, 5))))
    ),
    Quantity("commanded_lambda", "obd", "commanded_lambda", "", 0.0, 20.0,
             "air-fuel equivalence ratio asked for (PID 44)"),
    Quantity("fuel_rate", "obd", "fuel_rate", "lph", 0.0, 1e-4, "fuel volume flow (PID 5E)"),
    Quantity("relative_throttle", "obd", "relative_throttle", "pct", -0.02, 1.02,
             "throttle position less the learned closed one (PID 45)"),
    Quantity("throttle_b", "obd", "throttle_b", "pct", -0.02, 1.02, "second throttle sensor (PID 47)"),
    Quantity("commanded_throttle", "obd", "commanded_throttle", "pct", -0.02, 1.02,
             "throttle position asked for (PID 4C)"),
    Quantity("accelerator_pedal", "obd", "accelerator_pedal", "pct", -0.02, 1.02,
             "accelerator pedal position (PID 49)"),
    Quantity("relative_pedal", "obd", "relative_pedal", "pct", -0.02, 1.02,
             "accelerator pedal position less the released one (PID 5A)"),
    Quantity("coolant_temperature", "obd", "coolant_temperature", "degc", _C - 50, _C + 215,
             "engine coolant temperature (PID 05)"),
    Quantity("intake_temperature", "obd", "intake_temperature", "degc", _C - 50, _C + 215,
             "intake air temperature (PID 0F)"),
    Quantity("oil_temperature", "obd", "oil_temperature", "degc", _C - 50, _C + 215,
             "engine oil temperature (PID 5C)"),
    Quantity("module_voltage", "obd", "module_voltage", "v", 0.0, 66.0,
             "supply voltage of the control module (PID 42)"),
    Quantity("battery_voltage", "obd", "battery_voltage", "v", 0.0, 1500.0,
             "voltage of the traction battery"),
    Quantity("battery_current", "obd", "battery_current", "a", -2000.0, 2000.0,
             "current of the traction battery, of either sign"),
    Quantity("fuel_level", "obd", "fuel_level", "pct", -0.02, 1.02, "fuel tank level (PID 2F)"),
    Quantity("run_time", "obd", "run_time", "s", 0.0, 66e3, "time since the engine started (PID 1F)"),
    Quantity("odometer", "obd", "odometer", "km", 0.0, 5e9, "distance the vehicle has gone (PID A6)"),
    Quantity("brake_switch", "obd", "brake_switch", "", 0.0, 1.0, "1 while the brake is pressed"),
    Quantity("clutch_switch", "obd", "clutch_switch", "", 0.0, 1.0, "1 while the clutch is pressed"),
    Quantity("retarder_torque", "obd", "retarder_torque", "pct", -1.3, 1.3,
             "torque of a retarder as a part of its reference torque, negative while it brakes (SPN 520)"),
    Quantity("maker_mass", "obd", "maker_mass", "kg", 100.0, 200e3,
             "mass that the vehicle itself reports, with its trailer where it knows of one (SPN 1760)"),
    Quantity("trailer_connected", "obd", "trailer_connected", "", 0.0, 1.0,
             "1 while a trailer is connected"),
    Quantity("latitude", "gnss", "latitude", "deg", -math.pi / 2, math.pi / 2, "WGS 84 latitude"),
    Quantity("longitude", "gnss", "longitude", "deg", -math.pi, math.pi, "WGS 84 longitude"),
    Quantity("altitude", "gnss", "altitude", "m", -500.0, 6000.0, "height"),
    Quantity("gnss_speed", "gnss", "speed", "mps", 0.0, 95.0, "speed over ground"),
    Quantity("gnss_course", "gnss", "course", "deg", -2 * math.pi, 2 * math.pi, "course over ground"),
    Quantity("hdop", "gnss", "hdop", "", 0.0, 100.0, "horizontal dilution of precision"),
    Quantity("gnss_accuracy", "gnss", "accuracy", "m", 0.0, 1e4, "horizontal accuracy"),
    Quantity("grade", "gnss", "grade", "rad", -0.5, 0.5, "road slope, positive uphill"),
    *(
        Quantity(f"suspension_travel_{w}", "ride", f"suspension_travel_{w}", "m", -1.0, 1.0,
                 f"suspension travel {where}, positive in extension")
        for w, where in _WHEELS.items()
    ),
    *(
        Quantity(f"suspension_rate_{w}", "ride", f"suspension_rate_{w}", "mps", -10.0, 10.0,
                 f"suspension rate {where}, positive in extension")
        for w, where in _WHEELS.items()
    ),
    Quantity("vertical_velocity", "ride", "vertical_velocity", "mps", -10.0, 10.0, "body velocity, up"),
    Quantity("roll_rate", "ride", "roll_rate", "radps", -9.0, 9.0, "roll rate, right side down"),
    Quantity("pitch_rate", "ride", "pitch_rate", "radps", -9.0, 9.0, "pitch rate, nose up"),
)  # fmt: skip

QUANTITIES: Final[dict[str, Quantity]] = {q.name: q for q in _ROWS}
"""Every quantity known, by its name inside the program."""

TABLES: Final = ("imu", "obd", "gnss", "ride")
"""Canonical tables of a drive folder."""

IMU_SIGNALS: Final = tuple(q.name for q in _ROWS if q.table == "imu")
"""Specific force and angular rate along the three axes of an inertial sensor."""

REPORTED_LOAD: Final = ("maker_mass", "trailer_connected")
"""What a vehicle says of its own load. Results show it; no mass is made of it."""

TIME_COLUMN: Final = "time_s"
"""The time column of every canonical table: seconds on one common clock."""
