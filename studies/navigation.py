"""Navigation on two recorded drives with known truth, and beside another package.

Run from the checkout: ``python studies/navigation.py``. The recordings lie in
``../shared/data`` and are not part of the project.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pymap3d

from weighbridge.constants import GRAVITY
from weighbridge.kernels.rotation import quaternion_to_matrix
from weighbridge.navigation.inertial import inertial_motion
from weighbridge.navigation.motion import Motion
from weighbridge.signals import Drive, Signal

DATA = Path(__file__).resolve().parents[2] / "shared" / "data"


def _signal(name, time, values):
    time, first = np.unique(np.asarray(time, float), return_index=True)
    return Signal(name, time, np.asarray(values, float)[first])


def load_comma(folder: Path, *, raw_gyro: bool = True, gnss_cut: float | None = None):
    """Load the highway minute: drive with fixes thinned to 1 Hz, truth time and pitch [rad].

    ``gnss_cut`` drops the fixes of the last so many seconds; ``raw_gyro`` takes the rates before
    the phone has removed their bias.
    """

    def load(name):
        return np.load(folder / f"{name}.npy")

    t0 = float(load("processed_log_IMU_accelerometer_t")[0])
    signals = []
    kind = "gyro_uncalibrated" if raw_gyro else "gyro"
    for stem, name in (("accel", "accelerometer"), ("gyro", kind)):
        t = load(f"processed_log_IMU_{name}_t") - t0
        y = load(f"processed_log_IMU_{name}_value")
        signals += [_signal(f"{stem}_{a}", t, y[:, i]) for i, a in enumerate("xyz")]
    signals.append(
        _signal(
            "vehicle_speed",
            load("processed_log_CAN_speed_t") - t0,
            load("processed_log_CAN_speed_value")[:, 0],
        )
    )
    t = load("processed_log_GNSS_live_gnss_ublox_t") - t0
    fix = load("processed_log_GNSS_live_gnss_ublox_value")
    keep = np.unique(np.searchsorted(t, np.arange(0.0, t[-1], 1.0)))
    if gnss_cut is not None:
        keep = keep[t[keep] < t[-1] - gnss_cut]
    # latitude, longitude, speed, epoch, altitude, course
    for name, values in (
        ("latitude", np.radians(fix[:, 0])),
        ("longitude", np.radians(fix[:, 1])),
        ("altitude", fix[:, 4]),
    ):
        signals.append(_signal(name, t[keep], values[keep]))
    time = load("global_pose_frame_times") - t0
    q = load("global_pose_frame_orientations")
    position = load("global_pose_frame_positions")
    lat, lon, _ = pymap3d.ecef2geodetic(*position[0], deg=False)
    sl, cl, so, co = math.sin(lat), math.cos(lat), math.sin(lon), math.cos(lon)
    ned_ecef = np.array([[-sl * co, -sl * so, cl], [-so, co, 0.0], [-cl * co, -cl * so, -sl]])
    pitch = np.empty(time.size)
    rot = np.empty((3, 3))
    for i in range(time.size):
        quaternion_to_matrix(q[i], rot)
        pitch[i] = -math.asin((ned_ecef @ rot)[2, 0])
    velocity = load("global_pose_frame_velocities") @ ned_ecef.T
    grade = np.arctan2(-velocity[:, 2], np.hypot(velocity[:, 0], velocity[:, 1]))
    return Drive("comma2k19", {s.name: s for s in signals}), time, pitch, grade


def load_rtk(folder: Path, *, seed: int | None = 0, noise: float = 1.5):
    """Load the drive in hills: drive, truth time and grade [rad].

    Fixes are the RTK track at 1 Hz with white noise on each axis; the vehicle
    speed is the horizontal Doppler speed, 4 Hz.
    """
    imu = np.loadtxt(folder / "imu_1934.csv", delimiter=",")
    rows = [
        line.split()
        for line in (folder / "gnss_1934_sf.pos").read_text().splitlines()
        if line and not line.startswith("%")
    ]
    clock = np.array([[float(p) for p in r[1].split(":")] for r in rows])
    data = np.array([[float(v) for v in r[2:]] for r in rows])
    # the logs share no clock: from their beginnings 3.4 s leave the inertial stamps about
    # 0.1 s late, which the navigation has to find
    t = clock @ [3600.0, 60.0, 1.0]
    t -= t[0] + 3.4
    lat, lon, height, velocity = (
        np.radians(data[:, 0]),
        np.radians(data[:, 1]),
        data[:, 2],
        data[:, 13:16],
    )
    stamps = (imu[:, 6] - imu[0, 6]) * 1e-3
    signals = [_signal(f"accel_{a}", stamps, imu[:, i] * GRAVITY) for i, a in enumerate("xyz")]
    signals += [
        _signal(f"gyro_{a}", stamps, np.radians(imu[:, 3 + i])) for i, a in enumerate("xyz")
    ]
    signals.append(_signal("vehicle_speed", t, np.hypot(velocity[:, 0], velocity[:, 1])))
    error = np.zeros((t.size, 3))
    if seed is not None:
        error = np.random.default_rng(seed).normal(scale=noise, size=(t.size, 3))
    noisy = pymap3d.ned2geodetic(error[:, 0], error[:, 1], error[:, 2], lat, lon, height, deg=False)
    for name, values in zip(("latitude", "longitude", "altitude"), noisy, strict=True):
        signals.append(_signal(name, t[::4], np.asarray(values)[::4]))

    # grade from RTK height over six metres of road to either side
    n, e, d = pymap3d.geodetic2ned(lat, lon, height, lat[0], lon[0], height[0], deg=False)
    travelled = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(n), np.diff(e)))])
    speed = np.hypot(velocity[:, 0], velocity[:, 1])
    distance, first = np.unique(travelled, return_index=True)
    up = -d[first]
    grade = np.arctan2(
        np.interp(travelled + 6.0, distance, up) - np.interp(travelled - 6.0, distance, up), 12.0
    )
    grade[(speed < 2.0) | (travelled < 6.0) | (travelled > travelled[-1] - 6.0)] = np.nan
    drive = Drive("rtk-grade", {s.name: s for s in signals})
    return drive, t, grade


def score(motion: Motion, time, truth, of: str, *, skip: float = 10.0):
    """Return mean and standard deviation of the error after the first seconds [deg].

    Truth instants are stamps of the speed's clock, so its delay is taken off.
    """
    keep = np.isfinite(truth) & (time > motion.time[0] + skip) & (time < motion.time[-1])
    at = np.interp(time[keep], motion.time, getattr(motion, of))
    error = np.degrees(at - truth[keep])
    return float(np.mean(error)), float(np.std(error))


def main() -> None:
    for raw in (True, False):
        for cut in (None, 20.0):
            drive, time, pitch, grade = load_comma(DATA / "comma2k19", raw_gyro=raw, gnss_cut=cut)
            motion = inertial_motion(drive)
            print(
                "comma2k19",
                "raw" if raw else "corrected",
                "gnss cut" if cut else "gnss",
                "pitch mean %.3f sd %.3f" % score(motion, time, pitch, "pitch"),
                "grade mean %.3f sd %.3f" % score(motion, time, grade, "grade"),
                "squat",
                motion.squat,
                motion.squat_std,
                "delay %.3f" % motion.speed_delay,
                "scale",
                motion.speed_scale,
                np.degrees(motion.mounting).round(2),
                motion.notes,
            )
    for seed in range(4):
        drive, time, grade = load_rtk(DATA / "rtk-grade", seed=seed)
        motion = inertial_motion(drive)
        print(
            "rtk-grade",
            seed,
            "grade mean %.3f sd %.3f" % score(motion, time - motion.speed_delay, grade, "grade"),
            "squat",
            motion.squat,
            motion.squat_std,
            "delay %.3f" % motion.speed_delay,
            "scale",
            motion.speed_scale,
            np.degrees(motion.mounting).round(2),
            motion.notes,
        )


if __name__ == "__main__":
    main()
