"""A check: an engine that runs so hot gives less than its full torque."""

from weighbridge.checks import Check
from weighbridge.signals import Problem

HOT = 388.0  # coolant [K]


def find(drive, vehicle):
    """Yield a note for a drive with a coolant above that."""
    coolant = drive.get("coolant_temperature")
    if coolant is not None and len(coolant) and coolant.values.max() > HOT:
        hot = coolant.time[coolant.values > HOT]
        yield Problem(
            id="engine.hot",
            text=f"the coolant reached {coolant.values.max() - 273.15:.0f} degrees Celsius",
            signal=coolant.name,
            start=float(hot[0]),
            end=float(hot[-1]),
        )


heat = Check(name="heat", find=find)
