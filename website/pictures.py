"""Pictures of the concepts, from simulated drives: ``python -m website.pictures``."""

from __future__ import annotations

import matplotlib
import numpy as np
from matplotlib.figure import Figure

import weighbridge as wb
from website.links import HOME
from weighbridge.balance import Reason
from weighbridge.constants import GRAVITY
from weighbridge.estimators.regression import regression
from weighbridge.simulation import SimulatedDrive, make_scenario, simulate_car

PLACE = HOME / "docs" / "pictures"
TEAL, ORANGE, GREY, RED = "#00796b", "#ef6c00", "#9e9e9e", "#c62828"
AIR_DENSITY = 1.2  # [kg/m^3]
STYLE = {
    "svg.hashsalt": "weighbridge",
    "svg.fonttype": "none",
    "font.family": "sans-serif",
    "font.size": 11,
    "axes.spines.top": False,
    "axes.spines.right": False,
}


def main() -> None:
    """Draw all pictures anew."""
    matplotlib.use("svg")
    matplotlib.rcParams.update(STYLE)
    known = [_drive(payload, seed) for payload, seed in ((0.0, 1), (200.0, 2), (400.0, 3))]
    car = wb.calibrate([d.drive for d in known], mass=[float(d.truth.mass[0]) for d in known])
    made = _drive(210.0, 4)
    weighed = wb.weigh(made.drive, car)
    draw_slope(weighed, car)
    draw_starts(weighed)
    draw_wind()
    draw_intervals(car)


def draw_slope(weighed: wb.Weighing, car: wb.Vehicle) -> None:
    """Draw the force left for the mass over the specific force, and the line of the mass."""
    balance = weighed.result.balance
    table = balance.table
    phi, force = regression(table, car)
    used = weighed.result.row_reason == Reason.USED
    start = used & (table.accel > 0.4)
    hill = used & ~start & (np.abs(table.grade) > 0.02)
    rest = used & ~start & ~hill
    figure = Figure((7.0, 4.2), layout="constrained")
    axes = figure.add_subplot()
    thin = max(1, int(np.count_nonzero(used)) // 900)
    for rows, colour, words in (
        (rest, GREY, "cruise"),
        (hill, ORANGE, "hill"),
        (start, TEAL, "speeding up"),
    ):
        axes.plot(
            phi[rows][::thin], force[rows][::thin] / 1e3, ".", ms=4, color=colour, label=words
        )
    reach = np.array([-0.5, 2.0])
    axes.plot(reach, weighed.mass * reach / 1e3, color=RED, lw=1.5)
    axes.annotate(
        f"slope: {weighed.mass:.0f} kg",
        (1.5, 1.5e-3 * weighed.mass),
        xytext=(1.2, 0.6),
        arrowprops={"arrowstyle": "->", "color": RED},
        color=RED,
    )
    axes.set(
        xlabel="specific force and rolling resistance over mass (m/s²)",
        ylabel="force less air drag\nand turning parts (kN)",
    )
    axes.legend(frameon=False, markerscale=2)
    _save(figure, "slope")


def draw_starts(weighed: wb.Weighing) -> None:
    """Draw the speed and, below, how the standard deviation falls."""
    track = weighed.track
    minutes = track["time_s"].to_numpy() / 60.0
    thin = max(1, minutes.size // 700)
    figure = Figure((7.0, 4.4), layout="constrained")
    upper, lower = figure.subplots(2, sharex=True)
    upper.plot(minutes[::thin], 3.6 * track["speed_mps"].to_numpy()[::thin], color=TEAL)
    upper.set(ylabel="speed (km/h)")
    lower.plot(minutes[::thin], track["std_kg"].to_numpy()[::thin], color=ORANGE)
    lower.set(ylabel="± of the mass (kg)", xlabel="time (min)", yscale="log")
    lower.set_yticks([20, 50, 100, 200, 500], labels=["20", "50", "100", "200", "500"])
    lower.minorticks_off()
    _save(figure, "starts")


def draw_wind() -> None:
    """Draw the error of the mass by a wind that nobody takes into account."""
    wind = np.linspace(-8.0, 8.0, 65)
    drag_area = 0.65  # [m^2]
    figure = Figure((7.0, 3.8), layout="constrained")
    axes = figure.add_subplot()
    for speed, specific, colour, words in (
        (50.0 / 3.6, 1.0, TEAL, "start in town: 50 km/h, 1 m/s²"),
        (80.0 / 3.6, 0.03 * GRAVITY, ORANGE, "hill: 80 km/h, 3 %"),
        (120.0 / 3.6, 0.15, RED, "motorway: 120 km/h, 0.15 m/s²"),
    ):
        extra = 0.5 * AIR_DENSITY * drag_area * ((speed + wind) ** 2 - speed**2)
        axes.plot(wind, extra / specific, color=colour, label=words)
    axes.axhline(0.0, color=GREY, lw=0.8)
    axes.set(
        xlabel="headwind at the vehicle (m/s); negative is tailwind",
        ylabel="mass too high by (kg)",
        ylim=(-1600.0, 2600.0),
    )
    axes.legend(frameon=False)
    _save(figure, "wind")


def draw_intervals(car: wb.Vehicle) -> None:
    """Draw the intervals of twenty drives about the truth."""
    figure = Figure((7.0, 4.2), layout="constrained")
    axes = figure.add_subplot()
    for number in range(20):
        made = _drive(40.0 * (number % 11), 500 + number)
        weighed = wb.weigh(made.drive, car)
        truth = float(made.truth.mass[-1])
        low, high = (bound - truth for bound in weighed.interval(0.95))
        colour = TEAL if low <= 0.0 <= high else RED
        axes.plot([number + 1] * 2, [low, high], color=colour, lw=2.5)
        axes.plot(number + 1, weighed.mass - truth, "o", color=colour, ms=4)
    axes.axhline(0.0, color=GREY, lw=1)
    axes.set(xlabel="drive", ylabel="estimated mass minus true mass (kg)")
    axes.set_xticks([1, 5, 10, 15, 20])
    _save(figure, "intervals")


def _drive(payload: float, seed: int) -> SimulatedDrive:
    return simulate_car(make_scenario("car-short", payload=payload, seed=seed))


def _save(figure: Figure, name: str) -> None:
    PLACE.mkdir(exist_ok=True)
    figure.savefig(
        PLACE / f"{name}.svg", metadata={"Date": None, "Creator": None}, facecolor="white"
    )


if __name__ == "__main__":
    main()
