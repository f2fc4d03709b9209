"""A simulated fleet as files: drives, vehicle files, tickets, and the truth beside them."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import polars as pl

from weighbridge.errors import ConfigError
from weighbridge.io.write import write_drive
from weighbridge.simulation.fleet import (
    FleetSettings,
    FleetVehicle,
    PlannedDay,
    plan_fleet,
    simulate_day,
    with_fault,
    with_torque_scale,
)
from weighbridge.simulation.simulate import SimulatedDrive
from weighbridge.vehicle import Known, Vehicle, describe
from weighbridge.whole import whole_folder

TRUTH: Final = {
    "vehicle": pl.String(),
    "class": pl.String(),
    "files": pl.String(),
    "start": pl.String(),
    "leg": pl.Int32(),
    "start_s": pl.Float64(),
    "end_s": pl.Float64(),
    "mass_kg": pl.Float64(),
    "tare_kg": pl.Float64(),
    "gross_kg": pl.Float64(),
    "trailer_kg": pl.Float64(),
    "trailer": pl.String(),
    "fault": pl.String(),
    "torque_scale": pl.Float64(),
}
"""Columns of ``truth.csv``: one row per leg, with the mass at its begin."""

TICKETS: Final = {"vehicle": pl.String(), "time": pl.String(), "mass_kg": pl.Float64()}
"""Columns of ``tickets.csv``: a weighbridge's tickets, rounded to its scale."""

_SCALE: Final = 20.0  # division of a weighbridge of 60 t [kg]
_DRAG_COEFFICIENT: Final = 0.6


def write_fleet(
    folder: Path,
    settings: FleetSettings,
    *,
    workers: int | None = None,
    tell: Callable[[int, int], None] | None = None,
) -> int:
    """Simulate a fleet and write it, whole or not at all.

    ::

        FOLDER/drives/truck001/2026-05-04T0512/    a drive
        FOLDER/vehicles/truck001.toml              what its papers say; some vehicles have none
        FOLDER/drives.csv                          files, vehicle, class and start of each drive
        FOLDER/tickets.csv                         vehicle, time and mass of weighed departures
        FOLDER/truth.csv                           each leg as it was

    Parameters
    ----------
    folder : must not be there yet
    settings
    workers : processes; as many as cores unless given
    tell : is given the days done and in all, after each

    Returns
    -------
    int
        Drives written.

    Raises
    ------
    ConfigError
        The folder is there, or cannot be written.
    """
    if os.path.lexists(folder):
        raise ConfigError(f"{folder}: exists already; name another folder")
    if workers is not None and workers < 1:
        raise ConfigError(f"workers must be at least 1, got {workers}")
    vehicles, days = plan_fleet(settings)
    rows: list[dict[str, Any]] = []
    tickets: list[dict[str, Any]] = []
    with whole_folder(folder, ()) as part:
        (part / "vehicles").mkdir()
        for vehicle in vehicles:
            if vehicle.has_file:
                vehicle_file(vehicle).save(part / "vehicles" / f"{vehicle.id}.toml")
        for done, (truth, weighed) in enumerate(_made(part, days, workers), start=1):
            rows += truth
            tickets += weighed
            if tell is not None:
                tell(done, len(days))
        by = ("vehicle", "start", "leg")
        table = pl.DataFrame(rows, schema=TRUTH, orient="row").sort(by)
        table.write_csv(part / "truth.csv")
        drives = table.unique("files", keep="first", maintain_order=True)
        drives.select("files", "vehicle", "class", "start").write_csv(part / "drives.csv")
        reported = pl.DataFrame(tickets, schema=TICKETS, orient="row").sort("vehicle", "time")
        reported.write_csv(part / "tickets.csv")
    return drives.height


def vehicle_file(vehicle: FleetVehicle) -> Vehicle:
    """Return what an owner knows of a vehicle: papers, ratios and size; nothing is calibrated."""
    car = vehicle.car
    known = Known(
        name=f"{car.name.removeprefix('random ')} {vehicle.id}",
        kind=vehicle.kind,
        engine=car.engine,
        tare=round(car.mass),
        gross=vehicle.gross,
        radius=round(car.wheel_radius, 3),
        gear_ratios=tuple(round(ratio, 3) for ratio in car.gear_ratios),
        final_drive=round(car.final_drive, 3),
        torque="measured" if car.electric else "percent",
        drag_coefficient=_DRAG_COEFFICIENT,
        frontal_area=round(car.drag_area / _DRAG_COEFFICIENT, 2),
    )
    return describe(known).vehicle


_Made = tuple[list[dict[str, Any]], list[dict[str, Any]]]


def _made(part: Path, days: Sequence[PlannedDay], workers: int | None) -> Any:
    """Yield truth and tickets of each day, in the order in which they are done."""
    count = min(workers or os.cpu_count() or 1, len(days))
    if count == 1:
        for day in days:
            yield _write_day(part, day)
        return
    # Processes that begin anew share no threads and no locks with this one.
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(count, mp_context=context) as pool:
        waiting = [pool.submit(_write_day, part, day) for day in days]
        try:
            for future in as_completed(waiting):
                yield future.result()
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise


def _write_day(part: Path, day: PlannedDay) -> _Made:
    """Simulate and write the drives of one vehicle and day."""
    rows: list[dict[str, Any]] = []
    tickets: list[dict[str, Any]] = []
    vehicle = day.vehicle
    for number, made in enumerate(simulate_day(day)):
        fault, start, trailer = day.faults[number], day.starts[number], day.trailers[number]
        inside = f"drives/{vehicle.id}/{made.drive.name}"
        info = replace(made.drive.info, mass=None, notes=None, vehicle=vehicle.id)
        read = with_torque_scale(made.drive, day.torque_scale)
        drive = replace(with_fault(read, fault), info=info)
        write_drive(drive, part / inside, "parquet")
        if fault == "broken file":
            # Cut in half, as a logger without power does.
            cut = part / inside / "obd.parquet"
            cut.write_bytes(cut.read_bytes()[: cut.stat().st_size // 2])
        for leg in _legs(made):
            rows.append(
                leg
                | {
                    "vehicle": vehicle.id,
                    "class": vehicle.kind,
                    "files": inside,
                    "start": start.isoformat(),
                    "tare_kg": round(vehicle.car.mass),
                    "gross_kg": vehicle.gross,
                    "trailer_kg": trailer.mass if trailer else 0.0,
                    "trailer": trailer.kind if trailer else "",
                    "fault": fault,
                    "torque_scale": day.torque_scale,
                }
            )
        if day.tickets[number]:
            shown = _SCALE * round(made.truth.mass[0] / _SCALE)
            tickets.append({"vehicle": vehicle.id, "time": start.isoformat(), "mass_kg": shown})
    return rows, tickets


def _legs(made: SimulatedDrive) -> list[dict[str, Any]]:
    """Masses of a drive, before and after a stop at which the load changed."""
    time, mass = made.truth.time, made.truth.mass
    ends = [float(time[-1])]
    begins = [float(time[0])]
    if made.scenario.loading:
        # Fuel burns slowly; the load changes within a minute.
        changing = np.flatnonzero(np.abs(np.diff(mass)) > 0.05)
        if changing.size:
            ends.insert(0, float(time[changing[0]]))
            begins.append(float(time[changing[-1] + 1]))
    return [
        {"leg": k, "start_s": a, "end_s": b, "mass_kg": round(float(np.interp(a, time, mass)), 1)}
        for k, (a, b) in enumerate(zip(begins, ends, strict=True))
    ]
