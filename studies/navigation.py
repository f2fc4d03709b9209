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
from weighbridge.kernels.rotation import euler_to_matrix, quaternion_to_matrix
from weighbridge.navigation.inertial import inertial_motion
from weighbridge.navigation.motion import Motion
from weighbridge.navigation.settings import NavigationSettings
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


def pyins_pitch(drive: Drive, truth, mounting, *, motion: Motion, start: float = 1.0):
    """Pitch of the body by pyins (PyPI ``python-ins``) with body velocity: time, pitch [rad].

    It is given more than our filter gets: the true mounting (roll, pitch, yaw)
    and the true first attitude; delay and scale of the speed, which it does
    not estimate, are those our ``motion`` found. ``truth`` has time, speed,
    heading, pitch, roll, latitude, longitude and altitude in SI.
    """
    import pandas as pd
    from pyins import filters, measurements, strapdown
    from pyins.inertial_sensor import EstimationModel

    settings = NavigationSettings()
    turn = euler_to_matrix(*mounting)
    time = drive.signals["accel_x"].time
    read = {
        kind: np.column_stack([drive.signals[f"{kind}_{a}"].values for a in "xyz"]) @ turn.T
        for kind in ("gyro", "accel")
    }
    imu = pd.DataFrame(
        np.hstack([read["gyro"], read["accel"]]),
        index=time,
        columns=["gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z"],
    )
    imu = imu[imu.index >= start]
    increments = strapdown.compute_increments_from_imu(imu, "rate")

    def at(name, t):
        return np.interp(t, truth.time, getattr(truth, name))

    t0 = float(imu.index[0])
    speed0, heading0 = at("speed", t0), at("heading", t0)
    pva = pd.Series(
        {
            "lat": np.degrees(at("latitude", t0)),
            "lon": np.degrees(at("longitude", t0)),
            "alt": at("altitude", t0),
            "VN": speed0 * np.cos(heading0),
            "VE": speed0 * np.sin(heading0),
            "VD": 0.0,
            "roll": np.degrees(at("roll", t0)),
            "pitch": np.degrees(at("pitch", t0)),
            "heading": np.degrees(heading0),
        },
        name=t0,
    )

    def snapped(t):
        return increments.index[
            np.clip(np.searchsorted(increments.index, t), 0, len(increments) - 1)
        ]

    lat = drive.signals["latitude"]
    fixes = pd.DataFrame(
        {
            "lat": np.degrees(lat.values),
            "lon": np.degrees(drive.signals["longitude"].at(lat.time)),
            "alt": drive.signals["altitude"].at(lat.time),
        },
        index=snapped(lat.time),
    )
    speed = drive.signals["vehicle_speed"]
    scale = motion.speed_scale or 1.0
    body = pd.DataFrame(
        {"VX": speed.values / scale, "VY": 0.0, "VZ": 0.0},
        index=snapped(speed.time - motion.speed_delay),
    )
    fixes, body = (d[~d.index.duplicated()].iloc[1:-1] for d in (fixes, body))
    result = filters.run_feedback_filter(
        pva, 5.0, 0.2, 0.5, 2.0, increments,
        EstimationModel(settings.gyro_bias_std, settings.gyro_density, settings.gyro_bias_walk),
        EstimationModel(settings.accel_bias_std, settings.accel_density, settings.accel_bias_walk),
        [measurements.Position(fixes, 3.0), measurements.BodyVelocity(body, 0.2)],
        time_step=0.1,
    )  # fmt: skip
    return np.asarray(result.trajectory.index), np.radians(result.trajectory["pitch"].to_numpy())


def compare_with_pyins(scenario: str = "car-short", seed: int = 1) -> dict[str, float]:
    """RMS error of body pitch on one simulated drive after 60 s, while moving [deg]."""
    from weighbridge.simulation import make_scenario
    from weighbridge.simulation.simulate import simulate_car

    made = simulate_car(make_scenario(scenario, seed=seed))
    truth = made.truth

    def rms(time, pitch):
        keep = (truth.time > truth.time[0] + 60.0) & (truth.speed > 1.0) & (truth.time < time[-1])
        error = np.interp(truth.time[keep], time, pitch) - truth.pitch[keep]
        return float(np.degrees(np.sqrt(np.mean(error**2))))

    smoothed = inertial_motion(made.drive)
    forward = inertial_motion(made.drive, settings=NavigationSettings(smooth=False))
    found = {
        "weighbridge": rms(smoothed.time, smoothed.pitch),
        "weighbridge, forward only": rms(forward.time, forward.pitch),
    }
    found["pyins"] = rms(
        *pyins_pitch(made.drive, truth, made.scenario.sensors.mounting, motion=smoothed)
    )
    return found


def report(name: str, motion: Motion, scores: dict[str, tuple[float, float]]) -> None:
    """Print one line."""
    parts = [f"{k}: mean {m:+.3f} sd {s:.3f} deg" for k, (m, s) in scores.items()]
    if motion.squat is not None:
        degrees = np.degrees([motion.squat, motion.squat_std])
        parts.append(f"squat {degrees[0]:.2f} +- {degrees[1]:.2f} deg per m/s^2")
    else:
        parts.append("squat not shown")
    parts.append(f"speed late by {motion.speed_delay:.3f} s, scale {motion.speed_scale:.4f}")
    print(f"{name:<28}", "; ".join(parts))


def main() -> None:
    for raw in (True, False):
        for cut in (None, 20.0):
            drive, time, pitch, grade = load_comma(DATA / "comma2k19", raw_gyro=raw, gnss_cut=cut)
            motion = inertial_motion(drive)
            name = f"comma2k19{' raw gyro' if raw else ''}{' GNSS cut' if cut else ''}"
            report(
                name,
                motion,
                {
                    "pitch": score(motion, time, pitch, "pitch"),
                    "grade": score(motion, time, grade, "grade"),
                },
            )
    for seed in range(6):
        drive, time, grade = load_rtk(DATA / "rtk-grade", seed=seed)
        motion = inertial_motion(drive)
        shifted = time - motion.speed_delay
        report(f"rtk-grade seed {seed}", motion, {"grade": score(motion, shifted, grade, "grade")})
    try:
        compared = compare_with_pyins()
    except ModuleNotFoundError as missing:
        print(f"no comparison with pyins: {missing}; pip install python-ins")
        return
    for name, value in compared.items():
        print(f"{name:<28} pitch rms {value:.3f} deg on car-short")


if __name__ == "__main__":
    main()
