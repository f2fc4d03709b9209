"""Logs of the reader's own that docs/data.md and docs/fleet.md name, made from simulated drives."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
from tests.fleet.fleets import tiny_fleet

from weighbridge.simulation import Sensors, make_scenario, simulate_car

AXES = "xyz"
PHONE = Sensors(imu_rate=50.0)
"""Of the inertial sensor 50 samples a second are logged."""


def own_data(folder: Path) -> None:
    """Write what docs/data.md weighs: a dongle with a phone, days of a truck, MF4 of a van."""
    for name, payload, seed, minutes in (("empty", 0.0, 1, 12.0), ("trip", 210.0, 2, 8.0)):
        tables = _tables(folder, "car", payload, seed, minutes)
        dongle_and_phone(tables, folder / name)
    (folder / "days").mkdir()
    for day, payloads in ((10, (1713.0, 7698.0, 4278.0)), (11, (3000.0,)), (12, (6000.0,))):
        drives = [_tables(folder, "truck", p, int(p), 10.0) for p in payloads]
        day_of_a_truck(drives, day, folder / "days" / f"2025-06-{day}.parquet")
    for run, payload in ((1, 226.0), (2, 1136.0), (3, 600.0)):
        mf4_of_a_van(_tables(folder, "van", payload, run, 10.0), folder / f"run_{run}.mf4")


def fleet(folder: Path) -> None:
    """Write what docs/fleet.md weighs: drives below drives/, a file for each vehicle, tickets."""
    tiny_fleet(folder, 3)
    rows = "van0,2026-05-01T06:00:02Z,2400\n"
    (folder / "tickets.csv").write_text(f"vehicle,time,mass_kg\n{rows}", encoding="utf-8")


def dongle_and_phone(tables: dict[str, pl.DataFrame], folder: Path) -> None:
    """Write the CSV of an app by times of day, and those of a phone by seconds since its start.

    Parameters
    ----------
    tables : of a simulated drive, by their names in a drive's folder
    folder : of the drive, not there yet
    """
    folder.mkdir()
    clock = (1e3 * (pl.col("time_s") + 50_000.0)).round().cast(pl.Int64) * 1_000_000
    tables["obd"].select(
        clock.cast(pl.Time).dt.to_string("%H:%M:%S%.3f").alias("time"),
        pl.col("vehicle_speed_kmh").alias("Vehicle speed (km/h)"),
        pl.col("engine_speed_rpm").alias("Engine RPM (rpm)"),
        pl.col("engine_load_pct").alias("Calculated engine load value (%)"),
    ).write_csv(folder / "elm327.csv")
    phone = (pl.col("time_s") + 11.0).alias("Time (s)")
    tables["imu"].select(
        phone,
        *(pl.col(f"accel_{a}_mps2").alias(f"Acceleration {a} (m/s^2)") for a in AXES),
        *(pl.col(f"gyro_{a}_radps").alias(f"Gyroscope {a} (rad/s)") for a in AXES),
    ).write_csv(folder / "phone_imu.csv")
    tables["gnss"].select(
        phone,
        pl.col("latitude_deg").alias("Latitude (°)"),
        pl.col("longitude_deg").alias("Longitude (°)"),
        pl.col("altitude_m").alias("Height (m)"),
        pl.col("speed_mps").alias("Velocity (m/s)"),
    ).write_csv(folder / "phone_location.csv")


def day_of_a_truck(drives: list[dict[str, pl.DataFrame]], day: int, path: Path) -> None:
    """Write drives of one day, two hours apart, into one Parquet file with a logger's names."""
    begin = 1.7488e9 + 86_400.0 * day
    parts = [
        pl.concat([tables["obd"], tables["gnss"]], how="diagonal").with_columns(
            (1e3 * (begin + 7200.0 * number + pl.col("time_s"))).cast(pl.Int64).alias("epoch_ms")
        )
        for number, tables in enumerate(drives)
    ]
    pl.concat(parts, how="diagonal").sort("epoch_ms").select(
        pl.col("epoch_ms").alias("timestamp_ms"),
        pl.col("vehicle_speed_kmh").alias("WheelBasedVehicleSpeed [km/h]"),
        pl.col("engine_speed_rpm").alias("EngineSpeed [rpm]"),
        pl.col("engine_torque_pct").alias("ActualEnginePercentTorque [%]"),
        pl.col("reference_torque_nm").alias("EngineReferenceTorque [Nm]"),
        pl.col("gear").alias("CurrentGear"),
        pl.col("retarder_torque_pct").alias("ActualRetarderPercentTorque [%]"),
        pl.col("brake_switch").alias("BrakeSwitch"),
        pl.col("latitude_deg").alias("Latitude [deg]"),
        pl.col("longitude_deg").alias("Longitude [deg]"),
        pl.col("altitude_m").alias("Altitude [m]"),
    ).write_parquet(path)


def mf4_of_a_van(tables: dict[str, pl.DataFrame], path: Path) -> None:
    """Write the channels of a van's control units and sensors into one MF4."""
    from asammdf import MDF, Signal

    named = {
        "obd": (
            ("vehicle_speed_kmh", "VCU_VehSpd", "km/h"),
            ("engine_speed_rpm", "ECM_EngSpd", "rpm"),
            ("engine_load_pct", "ECM_EngLoad", "%"),
        ),
        "imu": (
            *((f"accel_{a}_mps2", f"IMU_Acc{a.upper()}", "m/s^2") for a in AXES),
            *((f"gyro_{a}_radps", f"IMU_Gyro{a.upper()}", "rad/s") for a in AXES),
        ),
        "gnss": (
            ("latitude_deg", "GNSS_Latitude", "deg"),
            ("longitude_deg", "GNSS_Longitude", "deg"),
            ("altitude_m", "GNSS_Altitude", "m"),
        ),
    }
    file = MDF(version="4.10")
    for table, columns in named.items():
        for column, name, unit in columns:
            rows = tables[table].drop_nulls(column)
            values = rows[column].to_numpy().astype(np.float64)
            file.append([Signal(values, rows["time_s"].to_numpy(), name=name, unit=unit)])
    file.save(path, overwrite=True)
    file.close()


def _tables(
    folder: Path, name: str, payload: float, seed: int, minutes: float
) -> dict[str, pl.DataFrame]:
    """Simulate a drive and return its tables as they are written."""
    usual = make_scenario(name, payload=payload, seed=seed)
    scenario = replace(usual, duration=60.0 * minutes, sensors=PHONE)
    place = folder / "made" / f"{name}-{seed}"
    simulate_car(scenario).write(place)
    return {n: pl.read_parquet(place / f"{n}.parquet") for n in ("obd", "imu", "gnss")}
