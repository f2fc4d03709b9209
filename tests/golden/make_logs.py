"""Write the small logs of this folder: the same five seconds in every format.

Run it from anywhere: ``python tests/golden/make_logs.py``. The vehicle speeds
up from rest by 1.5 m/s^2 in a single gear of 40 rad/m, on the level, heading
north. `truth` is what any reader has to find.
"""

from pathlib import Path

import numpy as np
import polars as pl

HERE = Path(__file__).parent
OBD_TIME = np.arange(0.0, 5.05, 0.25)
IMU_TIME = np.arange(0.0, 5.005, 0.02)
GNSS_TIME = np.arange(0.0, 5.5, 1.0)


def truth(name: str, time: np.ndarray) -> np.ndarray:
    """Value of a quantity in SI."""
    match name:
        case "vehicle_speed" | "gnss_speed":
            return 1.5 * time
        case "engine_speed":
            return 60.0 * time
        case "engine_torque":
            return np.full_like(time, 80.0)
        case "accel_x":
            return np.full_like(time, 1.5)
        case "accel_z":
            return np.full_like(time, -9.81)
        case "latitude":
            return np.radians(48.0) + 0.75 * time**2 / 6.371e6
        case "longitude":
            return np.full_like(time, np.radians(11.0))
        case "altitude":
            return np.full_like(time, 500.0)
    return np.zeros_like(time)


def tables() -> dict[str, pl.DataFrame]:
    """Canonical tables."""
    return {
        "imu": pl.DataFrame(
            {
                "time_s": IMU_TIME,
                **{f"accel_{a}_mps2": truth(f"accel_{a}", IMU_TIME) for a in "xyz"},
                **{f"gyro_{a}_radps": truth(f"gyro_{a}", IMU_TIME) for a in "xyz"},
            }
        ),
        "obd": pl.DataFrame(
            {
                "time_s": OBD_TIME,
                "vehicle_speed_kmh": 3.6 * truth("vehicle_speed", OBD_TIME),
                "engine_speed_rpm": 30.0 / np.pi * truth("engine_speed", OBD_TIME),
                "engine_torque_nm": truth("engine_torque", OBD_TIME),
            }
        ),
        "gnss": pl.DataFrame(
            {
                "time_s": GNSS_TIME,
                "latitude_deg": np.degrees(truth("latitude", GNSS_TIME)),
                "longitude_deg": np.degrees(truth("longitude", GNSS_TIME)),
                "altitude_m": truth("altitude", GNSS_TIME),
                "speed_mps": truth("gnss_speed", GNSS_TIME),
            }
        ),
    }


def write_folder(folder: Path, suffix: str) -> None:
    """Write a canonical folder."""
    folder.mkdir(exist_ok=True)
    for name, frame in tables().items():
        if suffix == "csv":
            frame.write_csv(folder / f"{name}.csv")
        else:
            frame.write_parquet(folder / f"{name}.parquet")
    (folder / "drive.toml").write_text(
        'vehicle = "golden"\nmass_kg = 1580\nambient_temperature_degc = 20\nwind_from_deg = 90\n',
        encoding="utf-8",
    )


def write_foreign(folder: Path) -> None:
    """Write one foreign CSV, in Latin-1 with decimal commas, and its mapping."""
    rows = ["Zeit [ms];Geschwindigkeit [km/h];Motordrehzahl [1/min];Längsbeschl. [g];Höhe [m]"]
    for t in OBD_TIME:
        speed, engine = 3.6 * 1.5 * t, 30.0 / np.pi * 60.0 * t
        cells = [
            f"{1000 * t:.1f}",
            f"{speed:.10f}",
            f"{engine:.10f}",
            f"{-1.5 / 9.80665:.12f}",
            "500",
        ]
        rows.append(";".join(cells).replace(".", ","))
    (folder / "foreign.csv").write_text("\n".join(rows) + "\n", encoding="latin-1")
    (folder / "foreign.toml").write_text(
        """# How foreign.csv is written.
[csv]
separator = ";"
encoding = "latin-1"
decimal = ","

[time]
column = "Zeit [ms]"

[signals.vehicle_speed]
column = "Geschwindigkeit [km/h]"

[signals.engine_speed]
column = "Motordrehzahl [1/min]"

# Its axis points to the rear.
[signals.longitudinal_accel]
column = "Längsbeschl. [g]"
factor = -1

[signals.altitude]
column = "Höhe [m]"
""",
        encoding="utf-8",
    )


def write_mdf(folder: Path) -> None:
    """Write an MF4 of two channel groups, each on its own clock."""
    from asammdf import MDF
    from asammdf import Signal as MdfSignal

    file = MDF(version="4.10")
    obd = [
        ("vehicle_speed", 3.6 * truth("vehicle_speed", OBD_TIME), "km/h"),
        ("engine_speed_rpm", 30.0 / np.pi * truth("engine_speed", OBD_TIME), ""),
        ("MotTrq", truth("engine_torque", OBD_TIME), "Nm"),
    ]
    imu = [(f"accel_{a}", truth(f"accel_{a}", IMU_TIME) / 9.80665, "g") for a in "xyz"]
    for time, channels in ((OBD_TIME, obd), (IMU_TIME, imu)):
        file.append([MdfSignal(v, time, name=n, unit=u) for n, v, u in channels])
    file.save(folder / "log.mf4", overwrite=True)
    file.close()


if __name__ == "__main__":
    write_folder(HERE / "csv", "csv")
    write_folder(HERE / "parquet", "parquet")
    write_foreign(HERE)
    write_mdf(HERE)
