"""``weighbridge calibrate``: from drives of known mass to a vehicle file."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, NamedTuple

import typer

from weighbridge.cli.listed import method_names, option, source_names
from weighbridge.cli.options import (
    DbcPaths,
    DrivePaths,
    Elevation,
    MappingPath,
    Whole,
    chosen_mapping,
    load_parts,
)
from weighbridge.cli.progress import progress
from weighbridge.cli.results import Result, inputs, refuse_overwriting, refuse_results
from weighbridge.cli.terminal import complain, console, say
from weighbridge.cli.terminal import shown as _shown
from weighbridge.cli.verbosity import notice, say_written

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rich.table import Table

    from weighbridge.calibration import CalibrationSettings, SpeedCalibration
    from weighbridge.messages import Problem
    from weighbridge.pipeline.weighing import Weighing
    from weighbridge.results import Calibration
    from weighbridge.signals import Drive
    from weighbridge.vehicle import Vehicle

# Time that reading and fitting take, in weighings of the drive.
_READING: Final = 0.1
_FITTING: Final = 3.0

_LEFT: Final[dict[str, Any]] = {"title_justify": "left", "caption_justify": "left"}


def _kilograms(text: str) -> float:
    """Read one mass; several in one text are separated from what is no number."""
    try:
        return float(text)
    except ValueError:
        parts = text.replace(";", ",").split(",")
        # A comma may be that of a decimal: no vehicle is lighter than 100 kg.
        several = len(parts) > 1 and all(re.fullmatch(r"\s*\d{3,}(\.\d+)?\s*", p) for p in parts)
        more = " ".join(f"--mass {p.strip()}" for p in parts)
        remedy = f"repeat --mass, as {more}" if several else "give a number of kg"
        raise typer.BadParameter(f"{text!r} is no mass: {remedy}") from None


def calibrate(
    drives: DrivePaths,
    output: Annotated[Path, option("--output")],
    mass: Annotated[list[float] | None, option("calibrate --mass", parser=_kilograms)] = None,
    vehicle: Annotated[Path | None, option("calibrate --vehicle")] = None,
    tare: Annotated[float | None, option("calibrate --tare")] = None,
    method: Annotated[str, option("calibrate --method", autocompletion=method_names)] = "joint",
    order: Annotated[int | None, option("calibrate --order", min=0, max=4)] = None,
    torque: Annotated[str | None, option("--torque", autocompletion=source_names)] = None,
    grid: Annotated[bool, option("calibrate --grid")] = False,
    changes: Annotated[list[str] | None, option("calibrate --set")] = None,
    straight: Annotated[bool, option("calibrate --straight")] = False,
    whole: Whole = False,
    mapping: MappingPath = None,
    dbc: DbcPaths = None,
    elevation: Elevation = None,
    force: Annotated[bool, option("--force")] = False,
) -> None:
    """Calibrate a vehicle from drives of known mass.

    A recording of several drives (such as a file of a whole day) is split as `weighbridge weigh`
    splits it. `weighbridge inspect` lists its drives.

    Example: weighbridge calibrate drive-empty/ --mass 1580 -o car.toml
    """
    from weighbridge.arguments import check_choice
    from weighbridge.calibration import CalibrationSettings, TrainingSettings, with_findings
    from weighbridge.estimators import changed, parsed
    from weighbridge.pipeline.given import dbcs_beside, mapping_beside
    from weighbridge.vehicle import TORQUE_SOURCES, Vehicle

    refuse_overwriting(output, force, "vehicle file")
    if torque is not None:
        check_choice("--torque", torque, TORQUE_SOURCES)
    base = Vehicle.load(vehicle) if vehicle is not None else None
    chosen = chosen_mapping(base, vehicle, mapping)
    read = inputs(drives, vehicle, chosen, dbc)
    refuse_results(read, [Result("--output", output, "vehicle file")])
    settings = CalibrationSettings(
        order=order,
        source=torque,
        grid=grid,
        training=changed(TrainingSettings(), parsed(changes or [])),
        curved=not straight,
        method=method,
    )
    if not settings.fit.torque:
        _refuse_torque_options(torque, order, grid, straight)
    with progress("calibrating", len(drives) * (_READING + _FITTING + 1.0)) as bar:
        parts = []
        for path in drives:
            bar.begin(f"reading {path.name}", _READING)
            parts.append(load_parts(path, chosen, dbc, whole=whole, elevation=elevation))
        recorded = [drive for held in parts for drive in held]
        masses = masses_of_parts(parts, mass)
        for held in (h for h in parts if len(h) > 1):
            notice(f"  note: {_stated_parts(held)}")
        bar.total = len(drives) * _READING + len(recorded) * (_FITTING + 1.0)
        bar.begin(f"fitting {_counted(len(recorded))}", len(recorded) * _FITTING)
        car, found, notes = _fitted(recorded, masses, base, settings, tare, bar.within)
        if chosen is not None:
            car = replace(car, mapping=mapping_beside(chosen, output))
        if dbc:
            read_with = tuple(dbcs_beside(dbc, output))
            car = replace(car, provenance=replace(car.provenance, dbc=read_with))
        own = None
        if settings.fit.torque and not settings.grid:
            bar.begin("weighing by it", len(recorded))
            own = own_masses(car, recorded, bar.within)
            notes += own.lines
            if own.doubt is not None:
                car = with_findings(car, (*car.provenance.problems, own.doubt))
        car.save(output)
    console().print(found)
    for line in notes:
        say(line)
    say_written(output)
    if own is not None and own.doubt is not None:
        complain(f"weighbridge: {output}: {own.doubt.text}")
        if own.useless:
            raise typer.Exit(1)


def _fitted(
    recorded: list[Drive],
    masses: list[float] | None,
    base: Vehicle | None,
    settings: CalibrationSettings,
    tare: float | None,
    tell: Callable[[int, int], None],
) -> tuple[Vehicle, Table, list[str]]:
    """Fit a vehicle; return it, what the terminal shows of it, and notes."""
    from weighbridge.calibration import run_calibration, run_speed_calibration, run_training

    if settings.grid:
        trained = run_training(recorded, masses, vehicle=base, settings=settings)
        car = trained.vehicle
        if tare is not None:
            car = _with_tare(car, tare, car.provenance.masses[0])
        return car, training_table(car), []
    if settings.fit.torque:
        done = run_calibration(recorded, masses, vehicle=base, settings=settings, progress=tell)
        if tare is not None:
            lightest = min(done.vehicle.provenance.masses)
            done = replace(done, vehicle=_with_tare(done.vehicle, tare, lightest))
        return done.vehicle, table(done), []
    by_speed = run_speed_calibration(recorded, masses, vehicle=base)
    car = by_speed.vehicle
    if tare is not None:
        car = _with_tare(car, tare, min(rows.mass for rows in by_speed.rows))
    return car, speed_table(by_speed), [f"  note: {doubt}" for doubt in by_speed.warnings]


def _counted(drives: int) -> str:
    return "1 drive" if drives == 1 else f"{drives} drives"


def _with_tare(car: Vehicle, tare: float, lightest: float) -> Vehicle:
    """Return a vehicle with its mass without payload, checked by the lightest known mass [kg]."""
    from weighbridge.calibration import tared
    from weighbridge.errors import ConfigError

    if not 0.3 * lightest <= tare <= 1.02 * lightest:
        raise ConfigError(
            f"--tare {tare:g}: must not be above the known mass of {lightest:g} kg nor far below; "
            "it is the vehicle without payload"
        )
    return tared(car, tare)


def masses_of_parts(
    parts: Sequence[Sequence[Drive]], masses: Sequence[float] | None
) -> list[float] | None:
    """Masses of the drives that recordings hold, in order [kg].

    Parameters
    ----------
    parts : drives of each recording
    masses : as given: one of all, one for each recording, or one for each drive; None where each
        drive shows its own

    Raises
    ------
    ConfigError
        There are as many as neither recordings nor drives.
    """
    from weighbridge.errors import ConfigError

    if masses is None:
        return None
    drives = sum(map(len, parts))
    if len(masses) == 1:
        return list(masses) * drives
    if len(masses) == drives:
        return list(masses)
    if len(masses) == len(parts):
        return [kg for kg, held in zip(masses, parts, strict=True) for _ in held]
    several = "; ".join(_stated_parts(held) for held in parts if len(held) > 1)
    raise ConfigError(
        f"{len(masses)} masses for {drives} drives in {len(parts)} recording(s): give --mass "
        f"once, or once for each{'; ' + several if several else ''}"
    )


def _stated_parts(held: Sequence[Drive]) -> str:
    """Say which drives a recording holds, in the order their masses are given."""
    from weighbridge.signals.instants import span

    spans = ", ".join(span(float(round(d.start)), float(round(d.end))) for d in held)
    name = held[0].name.rsplit(" part ", 1)[0]
    return f"{_shown(name)} holds {len(held)} drives: {spans}"


def _refuse_torque_options(
    torque: str | None, order: int | None, grid: bool, straight: bool
) -> None:
    from weighbridge.errors import ConfigError

    asked = {"--torque": torque, "--order": order, "--grid": grid, "--straight": straight}
    for name, value in asked.items():
        if value not in (None, False):
            raise ConfigError(f"{name} is about torque, which --method speed-ekf does not read")


def speed_table(done: SpeedCalibration) -> Table:
    """Show what was fitted to the speed, and what it is worth."""
    from rich.table import Table

    model = done.vehicle.speed_model
    assert model is not None
    shown = Table(title=f"speed model of {_shown(done.vehicle.name)}", **_LEFT)
    shown.add_column("parameter")
    shown.add_column("value", justify="right")
    shown.add_row("known mass (kg)", ", ".join(f"{rows.mass:.0f}" for rows in done.rows))
    for k, p in enumerate(model.corrections, 1):
        shown.add_row(f"correction p{k}", f"{p:.5g}")
    shown.add_row("R² of the change of speed", f"{done.fit.r_squared:.3f}")
    shown.add_row(f"steps of {model.sample_time:g} s", str(done.fit.samples))
    shown.add_row("left in every mass (%)", f"{100.0 * model.scale_std:.0f}")
    shown.caption = (
        "Torque in proportion to speed hardly shows the mass: weighing by speed alone gives back "
        "the mass of this calibration."
    )
    return shown


def training_table(car: Vehicle) -> Table:
    """Show what the training of Jensen 2022 found."""
    from rich.table import Table

    from weighbridge.balance.law import ROAD_PARAMETERS

    shown = Table(title=f"training of {_shown(car.name)} as Jensen 2022", **_LEFT)
    shown.add_column("parameter")
    shown.add_column("value", justify="right")
    shown.add_row("gearings (1/m)", ", ".join(f"{g:.1f}" for g in car.driveline.gearings))
    road = (
        car.road_load.drag_area, car.road_load.rolling_coefficient,
        car.driveline.engine_inertia, car.driveline.wheel_inertia,
    )  # fmt: skip
    for name, value in zip(ROAD_PARAMETERS, road, strict=True):
        shown.add_row(name, f"{value:.4g}")
    for k, weight in enumerate(car.torque.coefficients):
        shown.add_row(f"w{k} of eq. 49", f"{weight:.4g}")
    shown.add_row("R² of the torque", f"{car.provenance.r_squared:.3f}")
    return shown


def table(done: Calibration) -> Table:
    """Show what was found, with its standard deviation: the numbers of the vehicle file."""
    from rich.table import Table

    vehicle = done.vehicle
    shown = Table(title=f"calibration of {_shown(vehicle.name)}", **_LEFT)
    shown.add_column("parameter")
    shown.add_column("value", justify="right")
    shown.add_column("std", justify="right")
    for figure in done.figures:
        shown.add_row(figure.name, figure.value, figure.std)
    if vehicle.provenance.notes:
        shown.caption = _shown(vehicle.provenance.notes)
    return shown


class OwnMasses(NamedTuple):
    """What the drives of a calibration weigh by its file.

    Attributes
    ----------
    lines : what each drive weighs, and what `weigh` would note of it
    doubt : what is to be said of the file; None where it weighs all of its drives as they are known
    useless : whether it weighs none of them
    """

    lines: list[str]
    doubt: Problem | None
    useless: bool


def own_masses(
    car: Vehicle, drives: Sequence[Drive], progress: Callable[[int, int], None] | None = None
) -> OwnMasses:
    """Weigh each drive with its own calibration.

    Parameters
    ----------
    car : as calibrated
    drives : of the calibration, in its order
    progress : reported of drives weighed of all
    """
    from weighbridge.errors import WeighbridgeError
    from weighbridge.messages import Problem
    from weighbridge.pipeline.weighing import DEFAULT_METHOD, weigh

    made = car.provenance
    lines = ["its own drives, weighed with it (they made it, so this is no proof of others):"]
    unweighed, outside = [], []
    for k, (drive, kg) in enumerate(zip(drives, made.masses, strict=True)):
        if progress is not None:
            progress(k, len(drives))
        try:
            own = weigh(drive, car, made.method or DEFAULT_METHOD)
        except WeighbridgeError as error:
            lines.append(f"  {drive.name}: no mass: {error}")
            unweighed.append((drive.name, str(error)))
            continue
        if own.status == "converged":
            low, high = (100.0 * (bound / kg - 1.0) for bound in own.interval(0.95))
            lines.append(
                f"  {drive.name}: {own.mass:.0f} kg, {100.0 * (own.mass / kg - 1.0):+.1f} % of the "
                f"{kg:.0f} kg known (95 % between {low:+.1f} and {high:+.1f} %)"
            )
            if not low <= 0.0 <= high:
                outside.append((drive.name, _words(own, kg)))
        else:
            lines.append(f"  {drive.name}: no mass ({own.status}): {own.reason}")
            unweighed.append((drive.name, own.reason))
        lines += [f"    note: {p.text}" for p in own.problems if p.line not in made.doubts]
    useless, doubt = len(unweighed) == len(drives), None
    if found := unweighed or outside:
        about: dict[str, Any] = {
            "drive": found[0][0],
            "reason" if unweighed else "words": found[0][1],
        }
        if useless:
            which = "calibration.own_unweighed" if len(drives) == 1 else "calibration.all_unweighed"
        else:
            which = "calibration.some_unweighed" if unweighed else "calibration.outside"
            about |= {"count": len(found), "drives": len(drives)}
        doubt = Problem.of(which, **about)
    return OwnMasses(lines, doubt, useless)


def _words(own: Weighing, known: float) -> str:
    """Say what a drive weighs, and the loads that it seems to have had."""
    reported = f"{own.mass:.0f} kg in place of {known:.0f} kg"
    if not own.load_changed:
        return reported
    loads = ", ".join(f"{part.mass:.0f}" for part in own.segments)
    return f"{reported}; its load seems to change: {loads} kg in turn"
