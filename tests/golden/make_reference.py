"""Write what a reference drive comes to: ``python tests/golden/make_reference.py``.

A car is calibrated on one simulated drive and weighs another. ``reference.csv`` has the states of
the weighing once a second, ``reference_car.csv`` what the calibration found. A commit that changes
results changes these files, so that its numbers can be seen.
"""

from pathlib import Path

import numpy as np
import polars as pl

import weighbridge as wb
from weighbridge.simulation import make_scenario, simulate_car

FOLDER = Path(__file__).parent
STATES = FOLDER / "reference.csv"
CAR = FOLDER / "reference_car.csv"
DIGITS = {
    "mass_kg": 2,
    "std_kg": 3,
    "grade_rad": 6,
    "speed_mps": 4,
    "specific_force_mps2": 5,
}
"""Columns of the track, and decimals of each."""


def weighing() -> tuple[wb.Vehicle, wb.Weighing]:
    """Calibrate on one drive and weigh another, 240 kg heavier."""
    known = simulate_car(make_scenario("car-calibration", seed=301))
    loaded = simulate_car(make_scenario("car-short", payload=240.0, seed=302))
    car = wb.calibrate(known.drive, float(known.truth.mass[0]))
    return car, wb.weigh(loaded.drive, car)


def states(weighed: wb.Weighing) -> pl.DataFrame:
    """Return the states at whole seconds."""
    track = weighed.track
    time = track["time_s"].to_numpy()
    seconds = np.arange(np.ceil(time[0]), time[-1])
    columns = {"time_s": seconds}
    for name, digits in DIGITS.items():
        values = track[name].cast(pl.Float64).fill_null(np.nan).to_numpy()
        known = np.isfinite(values)
        columns[name] = np.round(np.interp(seconds, time[known], values[known]), digits)
    return pl.DataFrame(columns)


def calibrated(car: wb.Vehicle) -> pl.DataFrame:
    """Return the numbers that the calibration found, in SI."""
    numbers = {
        "drag_area": car.road_load.drag_area,
        "rolling_coefficient": car.road_load.rolling_coefficient,
        "engine_inertia": car.driveline.engine_inertia,
        "wheel_inertia": car.driveline.wheel_inertia,
        "torque_delay": car.timing.torque_delay,
        "torque_lag": car.timing.torque_lag,
        "squat": car.mounting.squat,
        "mass_scale_std": car.provenance.mass_scale_std,
    }
    numbers |= {f"gearing_{k}": v for k, v in enumerate(car.driveline.gearings, 1)}
    numbers |= {f"coefficient_{k}": v for k, v in enumerate(car.torque.coefficients)}
    values = [f"{np.nan if v is None else v:.5g}" for v in numbers.values()]
    return pl.DataFrame({"name": list(numbers), "value": np.array(values, dtype=float)})


if __name__ == "__main__":
    car, weighed = weighing()
    states(weighed).write_csv(STATES)
    calibrated(car).write_csv(CAR)
