"""Make drives: a folder of tables as a logger would leave them, with the truth beside them."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
import polars as pl

from .driver import STYLES, random_driver
from .gearboxes import hybridised
from .motion import DT, RATE, Day, Driver, Road, run
from .road import Surroundings, make_road
from .sensing import AT, Logger, gnss, imu, obd
from .vehicle import Vehicle

TRUTH_RATE = 4.0
TRUTH = {
    "speed_mps": "speed",
    "accel_mps2": "accel",
    "distance_m": "distance",
    "altitude_m": "altitude",
    "grade_rad": "grade",
    "pitch_rad": "pitch",
    "gear": "gear",
    "engine_speed_radps": "engine_speed",
    "engine_torque_nm": "engine_torque",
    "engine_brake_torque_nm": "engine_brake_torque",
    "mass_kg": "mass",
    "headwind_mps": "headwind",
    "crosswind_mps": "crosswind",
    "brake_force_n": "brake_force",
    "drag_force_n": "drag_force",
    "rolling_force_n": "rolling_force",
    "traction_force_n": "traction_force",
    "coupled_force_n": "coupled_force",
    "slip": "slip",
    "pedal": "pedal",
    "clutch_open": "clutch_open",
}


class Motion(NamedTuple):
    """One drive before any sensor.

    Attributes
    ----------
    out : (n, columns) rows of ``motion.COLUMNS``
    day : the conditions
    driver : the driver
    road, around : the road and what lies along it
    air : ambient temperature [degC]
    height : above the sea where the drive begins [m]
    """

    out: np.ndarray
    day: Day
    driver: Driver
    road: Road
    around: Surroundings
    air: float
    height: float


def random_day(
    vehicle: Vehicle, mass: float, warm: float | None, rng: np.random.Generator
) -> tuple[Day, float, float]:
    """Draw load, weather and warmth of one drive; return also temperature and height."""
    u = rng.uniform
    air = float(np.clip(rng.normal(12.0, 8.0), -10.0, 33.0))
    height = float(np.clip(np.exp(rng.normal(5.0, 1.0)), 0.0, 1500.0))
    pressure = 101325.0 * np.exp(-height / 8400.0) * (1.0 + 0.008 * rng.normal())
    if warm is None:
        warm = 1.0 if u() < 0.65 else u(0.0, 0.7)
    wind = float(np.clip(rng.weibull(1.8) * 4.0, 0.0, 12.0))
    tall = 0.75 if vehicle.engine.limit < 270.0 else 0.6  # share of the wind at 10 m
    heavy = vehicle.kind in ("truck", "semi", "electric_bus")
    load = max(0.0, mass - vehicle.tare) / (vehicle.gross - vehicle.tare)
    rain = u() < 0.15
    window = u() < 0.15 and not heavy
    wheel = np.clip(air, -10.0, 30.0)
    return (
        Day(
            mass=mass,
            density=float(pressure / (287.05 * (air + 273.15))),
            wind=wind * tall,
            wind_from=float(u(0.0, 2.0 * np.pi)),
            gust=float(u(0.12, 0.3)),
            engine_warmth=float(warm),
            oil_warmth=float(max(0.0, warm - u(0.0, 0.25))),
            tyre_warmth=float(max(0.0, warm - u(0.0, 0.3))),
            drag_factor=float(u(0.98, 1.03) * (u(1.08, 1.25) if u() < 0.06 and not heavy else 1.0)),
            window_time=float(u(200.0, 1500.0)) if window else 1e9,
            window_factor=float(u(1.02, 1.06)),
            # About 0.5 % per kelvin of the air (ISO 28580 corrects by 0.8 % for cars).
            rolling_factor=float(u(0.95, 1.06) * (1.0 - 0.004 * (wheel - 15.0))),
            leak=float(u(2e-5, 8e-5)) if u() < 0.05 else 0.0,
            wet=float(u(0.08, 0.25)) if rain else 0.0,
            squat_factor=float(u(0.92, 1.08)),
            seat_pitch=float(np.deg2rad(u(0.1, 0.9) * load + 0.1 * rng.normal())),
            accessory_factor=float(u(0.6, 1.4)),
            cycled=int(air > 17.0 or u() < 0.25 or heavy),
            grip=0.6 if rain else 0.9,
            draft=float(u(0.1, 0.3)),
        ),
        air,
        height,
    )


def simulate(
    vehicle: Vehicle,
    *,
    mass: float,
    seed: int,
    duration: float = 1800.0,
    style: str = "ordinary",
    warm: float | None = None,
    unload: float = 0.0,
) -> Motion:
    """Drive, without any sensor; see ``make_drive``."""
    if style not in STYLES:
        raise ValueError(f"style {style!r} is not known; use one of {', '.join(STYLES)}")
    if not 0.5 * vehicle.tare < mass < 2.0 * vehicle.gross:
        raise ValueError(f"mass {mass} kg does not fit {vehicle.name}, tare {vehicle.tare} kg")
    rng = np.random.default_rng([seed, 20])
    driver = random_driver(vehicle, style, rng)
    day, air, height = random_day(vehicle, mass, warm, rng)
    heavy = vehicle.kind in ("truck", "semi", "electric_bus")
    length = 400.0 + duration * (0.85 if style in ("motorway",) else 0.75) * min(
        vehicle.top_speed, 25.0 if heavy else 42.0
    )
    road, around = make_road(length, style, heavy, driver, unload, rng)
    out = run(vehicle.engine, vehicle.box, vehicle.body, driver, road, day, rng, int(duration / DT))
    return Motion(out, day, driver, road, around, air, height)


def _write(path: Path, table: dict[str, np.ndarray]) -> None:
    columns = [pl.Series(name, values).fill_nan(None) for name, values in table.items()]
    pl.DataFrame(columns).write_parquet(path)


def make_drive(
    folder: str | Path,
    vehicle: Vehicle,
    *,
    mass: float,
    seed: int,
    duration: float = 1800.0,
    style: str = "ordinary",
    logger: Logger | None = None,
    warm: float | None = None,
    unload: float = 0.0,
) -> pl.DataFrame:
    """Make one drive and write its folder.

    Parameters
    ----------
    folder : gets imu, obd, gnss and truth as Parquet, and drive.toml
    vehicle : from ``random_vehicle``
    mass : as the drive begins [kg]
    seed : of road, driver, weather and sensors
    duration : [s]
    style : one of ``STYLES``
    logger : what is recorded; polled if not given
    warm : 0 for a cold start to 1 for all warm; drawn if not given
    unload : mass taken off at the longer stops [kg]

    Returns
    -------
    pl.DataFrame
        The truth, four rows per second, as in truth.parquet.
    """
    logger = logger or Logger()
    m = simulate(
        vehicle, mass=mass, seed=seed, duration=duration, style=style, warm=warm, unload=unload
    )
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng([seed, 40])
    battery = None
    if vehicle.hybrid is not None:
        shared, battery = hybridised(m.out, vehicle, np.random.default_rng([seed, 60]))
        m = m._replace(out=shared)
    _write(folder / "imu.parquet", imu(m.out, vehicle, logger, rng))
    _write(folder / "obd.parquet", obd(m.out, vehicle, logger, m.air, rng, battery))
    if logger.gnss:
        around = gnss(m.out, m.around, m.road.step, logger, m.height, rng)
        _write(folder / "gnss.parquet", around)
    step = round(RATE / TRUTH_RATE)
    rows = np.arange(step - 1, m.out.shape[0], step)
    truth = pl.DataFrame(
        {"time_s": (rows + 1) / RATE, **{a: m.out[rows, AT[b]] for a, b in TRUTH.items()}}
    )
    truth.write_parquet(folder / "truth.parquet")
    (folder / "drive.toml").write_text(
        f'vehicle = "{vehicle.name}"\nmass_kg = {mass:.1f}\n'
        f"ambient_temperature_degc = {m.air:.1f}\n",
        encoding="utf-8",
    )
    return truth
