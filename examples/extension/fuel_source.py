"""A torque source: fuel rate and a usual efficiency."""

from weighbridge.vehicle.torque_sources import ROUGH

HEATING_VALUE = 43.0e6  # [J/kg]
DENSITY = 745.0  # [kg/m^3]
EFFICIENCY = 0.35


def reading(drive, time, constants):
    """Return the torque at the engine's shaft at these times [N m]."""
    speed = drive.signals["engine_speed"].at(time)
    power = HEATING_VALUE * DENSITY * drive.signals["fuel_rate"].at(time) * EFFICIENCY
    return power / speed.clip(min=50.0)


fuel = ROUGH(
    name="fuel",
    signals=("fuel_rate", "engine_speed"),
    reading=reading,
    floor=lambda readings: 1.0,
    title="fuel rate",
    words="fuel rate and a usual efficiency",
    axis="Torque from fuel [N m]",
    scale_std=0.1,
    transfer_std=0.02,
)
