"""Weigh the drives of `weighbridge benchmark` by mean engine power, speed and height."""

import tomllib
from pathlib import Path

import numpy as np
import polars as pl

BENCH = Path("bench")
STEP = 3.0  # seconds before and after a row that show its changes
READINGS = ("engine_torque_nm", "engine_torque_pct", "engine_load_pct")


def stated(path):
    """Read a TOML file."""
    return tomllib.loads(path.read_text(encoding="utf-8"))


def rows(drive):
    """Return power over speed, specific force with rolling resistance, and air drag."""
    area = stated(drive.parent / "vehicle.toml")["road_load"]["drag_area_m2"]
    obd, gnss = (pl.read_parquet(drive / f"{name}.parquet") for name in ("obd", "gnss"))
    reading = next(name for name in READINGS if name in obd.columns)
    time = np.arange(obd["time_s"].min() + STEP, obd["time_s"].max() - STEP, 1.0)

    def column(table, name):
        known = table.select("time_s", name).drop_nulls()
        at = [np.interp(time + k, known["time_s"], known[name]) for k in (-STEP, 0.0, STEP)]
        return at[0], np.mean(at, axis=0), at[2]

    before, speed, after = (np.array(v) / 3.6 for v in column(obd, "vehicle_speed_kmh"))
    low, _, high = column(gnss, "altitude_m")
    torque, turning = column(obd, reading)[1], column(obd, "engine_speed_rpm")[1]
    used = (speed > 3.0) & (torque > 0.3 * torque.max()) & (np.abs(after - before) < 9.0)
    accel, speed = (after - before)[used] / (2.0 * STEP), speed[used]
    grade = (high - low)[used] / (2.0 * STEP * speed)
    force = accel + 9.81 * (grade + 0.008)
    return (torque * turning)[used] / speed, force, 0.6 * area * speed**2


results = []
for drive, vehicle in pl.read_csv(BENCH / "drives.csv").select("drive", "vehicle").iter_rows():
    known = sorted((BENCH / vehicle).glob("calibration-*"))
    gains = []
    for path in known:
        mass = stated(path / "drive.toml")["mass_kg"]
        pull, force, drag = rows(path)
        gains.append(np.sum((mass * force + drag) * force) / np.sum(pull * force))
    if not gains:
        results.append((drive, None, None))
        continue
    pull, force, drag = rows(BENCH / drive)
    mass = np.sum((np.mean(gains) * pull - drag) * force) / np.sum(force**2)
    results.append((drive, mass, 0.1 * mass))
table = pl.DataFrame(results, ["drive", "mass_kg", "std_kg"], orient="row")
table.write_csv(BENCH / "mine.csv")
