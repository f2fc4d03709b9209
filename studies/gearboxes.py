"""How good are masses behind each kind of gearbox, and is one silently wrong? Run me.

    python studies/gearboxes.py

Vehicles of the second model and of our simulator, each of a kind of gearbox, are calibrated on
three drives of known mass and weighed on three others. It fills ``gearboxes.template.md``. The
seeds are used nowhere else, and nothing was tuned on them; ``--tuning`` takes others, and writes
nothing. With ``--only TEXT`` the rows of the kinds that hold the text are renewed, the others stay.
"""

from __future__ import annotations

import argparse
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from datetime import datetime
from pathlib import Path
from typing import Final

import numpy as np
from accuracy_drives import FULL, bare, scenario
from pages import filled
from second_model import VARIANTS, Logger, make_drive, random_variant, random_vehicle

import weighbridge as wb
from weighbridge.errors import WeighbridgeError
from weighbridge.papers.jensen2022_drives import without_weather
from weighbridge.signals import Drive
from weighbridge.simulation import random_vehicle as own_vehicle
from weighbridge.simulation import simulate_car, usual_polling

HERE: Final = Path(__file__).parent
JUDGED: Final = range(8461, 8465)
TUNED: Final = range(4601, 4605)
"""Seeds of the vehicles."""

DURATION: Final = 1200.0
KNOWN: Final = (0.1, 0.5, 0.9)
WEIGHED: Final = ((0.25, "ordinary"), (0.7, "city"), (0.95, "motorway"))
"""Payloads over the largest, and how the vehicle is driven [-]."""

FAR: Final = (0.03, 3.0)
"""A mass is wrong beyond both, in parts of it and in standard deviations, as in the corpus."""

Made = tuple[Drive, float, float]
"""A drive with its mass as it begins and as it ends [kg]."""


def _second(
    kind: str, logger: Logger, seed: int, base: str | None = None
) -> Iterator[tuple[wb.Vehicle, list[Made]]]:
    vehicle = (random_variant if kind in VARIANTS else random_vehicle)(kind, seed)
    heavy = {"truck": "truck", "semi": "truck", "electric_bus": "bus"}
    plan = [*((part, "ordinary") for part in KNOWN), *WEIGHED]
    made = []
    with tempfile.TemporaryDirectory() as home:
        for k, (part, style) in enumerate(plan):
            folder = Path(home) / str(k)
            mass = vehicle.tare + 75.0 + part * (vehicle.gross - vehicle.tare - 75.0)
            truth = make_drive(
                folder, vehicle, mass=mass, seed=100 * seed + k, style=style, duration=DURATION,
                logger=logger,
            )["mass_kg"]  # fmt: skip
            (folder / "drive.toml").unlink()
            made.append((wb.read_drive(folder), float(truth[0]), float(truth[-1])))
    yield wb.Vehicle(kind=base or heavy.get(vehicle.kind, "car")), made


def _own(kind: str, seed: int, base: str | None = None) -> Iterator[tuple[wb.Vehicle, list[Made]]]:
    rng = np.random.default_rng([seed, 46])
    car = own_vehicle(rng, kind)
    made = []
    for k, part in enumerate((*KNOWN, *(part for part, _ in WEIGHED))):
        drawn = scenario(
            car, rng, load=part * FULL[car.kind] * car.mass, seed=100 * seed + k,
            polling=usual_polling(car),
        )  # fmt: skip
        sensors = replace(drawn.sensors, imu_rate=100.0)
        drive = simulate_car(replace(drawn, duration=DURATION, sensors=sensors))
        seen = without_weather(drive.drive)
        seen = replace(seen, info=replace(seen.info, mass=None, vehicle=None))
        made.append((seen, float(drive.truth.mass[0]), float(drive.truth.mass[-1])))
    yield replace(bare(car), kind=base or car.kind), made


PLAIN: Final = Logger()
BATTERY: Final = Logger(battery=True)
BOTH: Final = Logger(battery=True, torque="nm")
RETARDER: Final = Logger(torque="percent", retarder=True)

KINDS: Final[dict[str, Callable[[int], Iterator[tuple[wb.Vehicle, list[Made]]]]]] = {
    "stepless (CVT)": lambda seed: _second("petrol_cvt", PLAIN, seed),
    "stepless (CVT), own": lambda seed: _own("petrol_cvt", seed),
    "automatic, petrol": lambda seed: _second("petrol_automatic", PLAIN, seed),
    "automatic, diesel": lambda seed: _second("diesel", PLAIN, seed),
    "automatic, diesel, own": lambda seed: _own("diesel_automatic", seed),
    "dual clutch": lambda seed: _second("petrol_dct", PLAIN, seed),
    "manual, clutch slips": lambda seed: _second("slipping_clutch", PLAIN, seed),
    "electric, two speeds": lambda seed: _second("two_speed_electric", PLAIN, seed),
    "electric, hub motors": lambda seed: _second("hub_motors", PLAIN, seed),
    "truck, retarder recorded": lambda seed: _second("truck", RETARDER, seed),
    "truck, retarder not recorded": lambda seed: _second(
        "truck", replace(RETARDER, retarder=False), seed
    ),
    "power split": lambda seed: _second("power_split", PLAIN, seed),
    "power split, battery recorded": lambda seed: _second("power_split", BATTERY, seed),
    "power split, battery and torque recorded, class stated": lambda seed: _second(
        "power_split", BOTH, seed, "hybrid"
    ),
    "power split, own, battery and torque recorded, class stated": lambda seed: _own(
        "petrol_hybrid", seed, "hybrid"
    ),
    "parallel hybrid": lambda seed: _second("parallel_hybrid", PLAIN, seed),
    "parallel hybrid, battery recorded": lambda seed: _second("parallel_hybrid", BATTERY, seed),
    "parallel hybrid, battery and torque recorded, class stated": lambda seed: _second(
        "parallel_hybrid", BOTH, seed, "hybrid"
    ),
    "mild hybrid": lambda seed: _second("mild_hybrid", PLAIN, seed),
    "mild hybrid, battery recorded": lambda seed: _second("mild_hybrid", BATTERY, seed),
}
"""What is recorded of the vehicle of a seed."""


@dataclass(frozen=True)
class Results:
    """Masses of some drives.

    Attributes
    ----------
    error, std : error and reported standard deviation of each drive, over the true mass [-]; NaN
        where it has no mass
    problems : ids of each drive
    no_file : ids of the calibrations that were refused
    """

    error: list[float] = field(default_factory=list)
    std: list[float] = field(default_factory=list)
    problems: list[frozenset[str]] = field(default_factory=list)
    no_file: list[str] = field(default_factory=list)

    def row(self, name: str) -> str:
        """Row of the table."""
        error, std = np.array([self.error, self.std])
        have = np.isfinite(error)
        wrong = have & (np.abs(error) > FAR[0]) & (np.abs(error) > FAR[1] * std)
        silent = sum(bool(w) and not ids for w, ids in zip(wrong, self.problems, strict=True))
        why = sorted({*self.no_file, *(i for h, ids in zip(have, self.problems, strict=True)
                                       if not h for i in ids)})  # fmt: skip
        cells = [name, f"{have.sum()} of {have.size}"]
        if have.any():
            error, std = error[have], std[have]
            scaled = np.mean((error / std) ** 2)
            cells += [
                f"{100.0 * np.sqrt(np.mean(error**2)):.1f} %", f"{100.0 * np.mean(error):+.1f} %",
                f"{100.0 * np.median(std):.1f} %",
                f"{np.count_nonzero(np.abs(error) < 1.96 * std)} of {error.size}",
                f"{scaled:.1f}",
            ]  # fmt: skip
        else:
            cells += ["–"] * 5
        cells += [f"{np.count_nonzero(wrong)}, {silent}", ", ".join(f"`{w}`" for w in why) or "–"]
        return f"| {' | '.join(cells)} |"


def _weighed(drive: Drive, car: wb.Vehicle | None) -> tuple[float, float, frozenset[str]]:
    """Mass and standard deviation, NaN where there is none [kg], and ids of problems."""
    nothing = float("nan")
    if car is None:
        return nothing, nothing, frozenset()
    try:
        w = wb.weigh(drive, car)
    except WeighbridgeError as error:
        return nothing, nothing, frozenset({error.problem.id if error.problem else str(error)})
    ids = {*(p.id for p in w.problems), w.reason_id or ""}
    return w.mass, w.std, frozenset(ids - {""})


def results(kind: str, seeds: range) -> Results:
    """Calibrate and weigh the vehicles of a kind."""
    found = Results()
    for seed in seeds:
        for base, made in KINDS[kind](seed):
            known, weighed = made[: len(KNOWN)], made[len(KNOWN) :]
            try:
                car = wb.calibrate([d for d, *_ in known], [m for _, m, _ in known], vehicle=base)
            except WeighbridgeError as error:
                found.no_file.append(error.problem.id if error.problem else str(error))
                car = None
            for drive, _, mass in weighed:
                one = _weighed(drive, car)
                found.error.append(one[0] / mass - 1.0)
                found.std.append(one[1] / mass)
                found.problems.append(one[2])
    return found


def main() -> None:
    """Write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tuning", action="store_true", help="other seeds; print the table only")
    parser.add_argument("--only", default="", help="kinds whose name holds this text")
    given = parser.parse_args()
    warnings.simplefilter("ignore", UserWarning)
    page = HERE / "gearboxes.md"
    known = page.read_text(encoding="utf-8").splitlines() if page.exists() else []
    rows = {kind: line for kind in KINDS for line in known if line.startswith(f"| {kind} |")}
    for kind in KINDS:
        if given.only in kind:
            begun = time.monotonic()
            found = results(kind, TUNED if given.tuning else JUDGED)
            rows[kind] = found.row(kind)
            print(rows[kind], f"{time.monotonic() - begun:.0f} s", flush=True)
            for error, std, ids in zip(found.error, found.std, found.problems, strict=True):
                print(f"  {100.0 * error:+.1f} ± {100.0 * std:.1f} %", *sorted(ids))
    if given.tuning:
        return
    table = "\n".join(rows[kind] for kind in KINDS if kind in rows)
    values = {"rows": table, "date": f"{datetime.now():%d %B %Y}".lstrip("0")}
    text = filled(HERE / "gearboxes.template.md", values)
    page.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
