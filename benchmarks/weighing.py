"""From Parquet to mass, calibration, grid and start-up: time and memory.

Run with an installed package, whose compiled code is cached: ``pip install . && python
benchmarks/weighing.py``. Peers in the same run: `rls` for `joint`, the grid of Jensen 2022 by one
regression per point, as printed, and SciPy's general least squares for the bounded fit.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from scipy.optimize import least_squares

COMMAND = [sys.executable, "-c", "from weighbridge.cli.main import run; run()"]


def timed(*arguments: str, runs: int = 3) -> tuple[float, float]:
    """Run a command; return the median wall time [s] and the largest peak memory [MB]."""
    times, peaks = [], []
    for _ in range(runs):
        begin = time.perf_counter()
        child = subprocess.Popen([*COMMAND, *arguments], stdout=subprocess.DEVNULL)
        _, status, usage = os.wait4(child.pid, 0)
        times.append(time.perf_counter() - begin)
        peaks.append(usage.ru_maxrss / 1024.0)
        child.returncode = os.waitstatus_to_exitcode(status)
        if child.returncode:
            raise SystemExit(f"{' '.join(arguments)} ended with {child.returncode}")
    return float(np.median(times)), max(peaks)


def commands(folder: Path) -> None:
    """Time the commands as a user runs them."""
    print(f"{'--help':<44}{timed('--help')[0]:8.2f} s")
    calib, drive, car = (str(folder / name) for name in ("calib", "drive", "car.toml"))
    subprocess.run([*COMMAND, "simulate", "car-calibration", "-o", calib], check=True)
    subprocess.run([*COMMAND, "simulate", "car", "-o", drive], check=True)
    subprocess.run([*COMMAND, "calibrate", calib, "-o", car], check=True)
    spent, peak = timed("weigh", drive, "--vehicle", car)
    print(f"{'weigh a 75-minute drive, Parquet to mass':<44}{spent:8.2f} s, {peak:.0f} MB")
    demo = timed("demo", "--no-open", "-o", str(folder / "demo.html"), runs=1)[0]
    print(f"{'demo, compiled code cached':<44}{demo:8.1f} s")


def calibration() -> None:
    """Time the calibration and its parts beside their peers."""
    from weighbridge.calibration import grid, regression
    from weighbridge.calibration.problem import problem_of
    from weighbridge.calibration.rls import torque_rows_of
    from weighbridge.calibration.run import run_calibration
    from weighbridge.calibration.settings import CalibrationSettings
    from weighbridge.simulation import make_scenario, simulate_car
    from weighbridge.vehicle.classes import VEHICLE_CLASSES

    made = simulate_car(make_scenario("car-calibration", seed=9))
    begin = time.perf_counter()
    again = simulate_car(make_scenario("car", seed=9))
    ratio = again.drive.duration / (time.perf_counter() - begin)
    print(f"{'simulate an 80-minute drive at 200 Hz':<44}{ratio:8.0f} x real time")
    mass = float(np.mean(made.truth.mass))
    run_calibration(made.drive, mass)
    begin = time.perf_counter()
    run_calibration(made.drive, mass)
    print(f"{'calibrate a 60-minute drive':<44}{time.perf_counter() - begin:8.2f} s")

    problem = problem_of(made.drive, mass, None, CalibrationSettings(method="rls"))
    rows = torque_rows_of(problem, [r.rows(0.1) for r in problem.recordings])
    low, high = VEHICLE_CLASSES["car"].road_bounds
    begin = time.perf_counter()
    fitted = regression.fit(rows, low, high)
    spent, weight = time.perf_counter() - begin, fitted.weight
    begin = time.perf_counter()
    grid.grid_search(rows, weight)
    ours = time.perf_counter() - begin
    few = tuple(axis[:: max(1, axis.size // 3)][:3] for axis in grid.TABLE_5)
    points = [(a, b, c, d) for a in few[0] for b in few[1] for c in few[2] for d in few[3]]
    torque, road = rows.design[:, :-4], rows.design[:, -4:]
    begin = time.perf_counter()
    for point in points:
        left = rows.target - road @ np.array(point)
        np.linalg.lstsq(torque, left, rcond=None)
    each = (time.perf_counter() - begin) / len(points)
    whole = each * int(np.prod([axis.size for axis in grid.TABLE_5]))
    print(f"{'grid of 123 750 points':<44}{ours:8.3f} s")
    print(
        f"{'  one regression per point (from 81 points)':<44}{whole:8.0f} s, {whole / ours:.0f} x"
    )

    free = np.full(torque.shape[1], np.inf)
    scale = np.sqrt(np.mean(rows.design**2, axis=0))
    bounds = np.concatenate([-free, low * scale[-4:]]), np.concatenate([free, high * scale[-4:]])
    start = np.concatenate([np.zeros(torque.shape[1]), 0.5 * (low + high) * scale[-4:]])
    begin = time.perf_counter()
    least_squares(
        lambda p: rows.design @ (p / scale) - rows.target,
        start,
        jac=lambda p: rows.design / scale,
        bounds=bounds,
        loss="huber",
        f_scale=1.345 * fitted.residual_std,
    )
    peer = time.perf_counter() - begin
    print(f"{'bounded robust fit':<44}{spent:8.3f} s")
    print(f"{'  scipy.optimize.least_squares':<44}{peer:8.3f} s, {peer / spent:.1f} x")


def methods() -> None:
    """Compare the joint estimator with recursive least squares, from drive to mass."""
    import weighbridge as wb
    from weighbridge.simulation import make_scenario, simulate_car

    made = simulate_car(make_scenario("car", seed=3))
    car = wb.calibrate(made.drive, made.scenario.mass)
    spent: dict[str, list[float]] = {"rls": [], "joint": []}
    for round_ in range(5):
        for method, times in spent.items():
            begin = time.process_time()
            wb.weigh(made.drive, car, method)
            # The first round compiles.
            if round_:
                times.append(time.process_time() - begin)
    ours, peer = min(spent["joint"]), min(spent["rls"])
    print(f"{'weigh by joint':<44}{ours:8.2f} s")
    print(f"{'  by rls':<44}{peer:8.2f} s, joint {100 * (ours / peer - 1):+.0f} %")


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        commands(Path(folder))
    calibration()
    methods()


if __name__ == "__main__":
    main()
