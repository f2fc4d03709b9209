"""Speed of the navigation filter beside filterpy's 15-state EKF, in one run.

Run from the checkout: ``python benchmarks/navigation.py``.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from filterpy.kalman import ExtendedKalmanFilter

from weighbridge.constants import GRAVITY
from weighbridge.kernels.ins import run
from weighbridge.kernels.ins_model import (
    ERRORS,
    MEASUREMENTS,
    SCALE,
    SHOWN,
    STATES,
    TIME,
    Z_SPEED,
    Z_SPEED_VAR,
    Z_STILL,
    Q,
    Samples,
    V,
    new_rows,
)
from weighbridge.navigation.inertial import inertial_motion
from weighbridge.navigation.settings import NavigationSettings
from weighbridge.signals import Drive, Signal


def best_of(times: int, work: Callable[[], object]) -> float:
    """Return the shortest of so many runs [s]."""
    spent = []
    for _ in range(times):
        begin = time.perf_counter()
        work()
        spent.append(time.perf_counter() - begin)
    return min(spent)


def kernel_rate(samples: int = 400_000) -> float:
    """IMU samples per second with covariance and three scalar rows at every sample."""
    rng = np.random.default_rng(0)
    stamps = np.arange(samples) / 200.0
    accel = np.array([0.0, 0.0, -GRAVITY]) + rng.normal(scale=0.05, size=(samples, 3))
    gyro = rng.normal(scale=0.002, size=(samples, 3))
    z = np.full((samples, MEASUREMENTS), np.nan)
    z[:, Z_STILL] = 0.0
    z[:, Z_SPEED] = 20.0
    z[:, Z_SPEED_VAR] = 0.25
    block = Samples(stamps, accel, gyro, np.arange(samples), z)
    states, stds = np.empty((samples, SHOWN)), np.empty(samples)
    noise = NavigationSettings().noise()

    def go() -> None:
        x = np.zeros(STATES)
        x[V], x[Q], x[SCALE], x[TIME] = 20.0, 1.0, 1.0, np.nan
        cov = (np.eye(ERRORS) * 1e-2).ravel()
        run(x, cov, block, np.eye(3), noise, new_rows(), states, stds)

    go()
    return samples / best_of(5, go)


def filterpy_rate(samples: int = 4_000) -> float:
    """Steps per second of filterpy's EKF with 15 states and three rows at every step."""
    ekf = ExtendedKalmanFilter(dim_x=15, dim_z=3)
    ekf.F = np.eye(15)
    ekf.F[:3, 3:6] = np.eye(3) * 0.005
    ekf.Q = np.eye(15) * 1e-6
    ekf.R = np.eye(3) * 0.25
    rows = np.zeros((3, 15))
    rows[:, 3:6] = np.eye(3)
    z = np.zeros((3, 1))

    def go() -> None:
        for _ in range(samples):
            ekf.predict()
            ekf.update(z, lambda x: rows, lambda x: rows @ x)

    return samples / best_of(3, go)


def long_drive(samples: int = 900_000) -> Drive:
    """A 75-minute drive at 200 Hz on a plane, with stops and bends."""
    rng = np.random.default_rng(1)
    t = np.arange(samples) / 200.0
    speed = np.clip(14.0 + 12.0 * np.sin(t / 30.0) + 4.0 * np.sin(t / 7.0), 0.0, None)
    accel = np.gradient(speed, t)
    yaw_rate = 0.08 * np.sin(t / 11.0) * np.minimum(speed / 5.0, 1.0)
    heading = np.cumsum(yaw_rate) / 200.0
    north = np.cumsum(speed * np.cos(heading)) / 200.0
    east = np.cumsum(speed * np.sin(heading)) / 200.0
    noise = rng.normal(size=(samples, 6)) * [0.05, 0.05, 0.05, 0.002, 0.002, 0.002]
    columns = {
        "accel_x": accel, "accel_y": speed * yaw_rate, "accel_z": np.full(samples, -GRAVITY),
        "gyro_x": 0.0 * t, "gyro_y": 0.0 * t, "gyro_z": yaw_rate,
    }  # fmt: skip
    signals = {
        name: Signal(name, t, values + noise[:, i])
        for i, (name, values) in enumerate(columns.items())
    }
    obd, fix = slice(None, None, 50), slice(None, None, 200)
    signals["vehicle_speed"] = Signal("vehicle_speed", t[obd], speed[obd])
    for name, values in (
        ("latitude", 0.9 + (north[fix] + rng.normal(size=t[fix].size)) / 6.37e6),
        ("longitude", 0.2 + (east[fix] + rng.normal(size=t[fix].size)) / 6.37e6 / np.cos(0.9)),
        ("altitude", 100.0 + 2.0 * rng.normal(size=t[fix].size)),
    ):
        signals[name] = Signal(name, t[fix], values)
    return Drive("long", signals)


def main() -> None:
    ours, theirs = kernel_rate(), filterpy_rate()
    print(f"filter kernel, 3 rows every sample   {ours / 1e6:6.2f} million samples/s")
    print(f"filterpy EKF, 15 states, 3 rows      {theirs / 1e6:6.3f} million steps/s")
    print(f"ratio                                {ours / theirs:6.1f}")
    drive = long_drive()
    inertial_motion(drive)
    smooth = best_of(3, lambda: inertial_motion(drive))
    forward_only = NavigationSettings(smooth=False)
    forward = best_of(3, lambda: inertial_motion(drive, settings=forward_only))
    print(f"inertial_motion, 900 000 samples     {smooth:6.2f} s, forward only {forward:.2f} s")


if __name__ == "__main__":
    main()
