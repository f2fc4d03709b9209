"""``weighbridge inspect``: what is in a drive, and how it could be weighed."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

from weighbridge.cli.listed import option
from weighbridge.cli.options import (
    DbcPaths,
    DrivePaths,
    MappingPath,
    Whole,
    chosen_mapping,
    load_parts,
)
from weighbridge.cli.results import asked_for, inputs, refuse_results, write_json
from weighbridge.cli.terminal import console, say, shown

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from weighbridge.pipeline.inspection import Inspection
    from weighbridge.vehicle import Vehicle

# Width of tables where no terminal gives one.
_WIDTH = 140
# Reference torque above those of cars and vans [N m].
_STRONG = 900.0
# Narrower, the rarer columns of the signals are left out.
_WHOLE = 116
# Narrower still, counts are left out too, so that numbers stay whole.
_NARROW = 76


def inspect(
    drives: DrivePaths,
    mapping: MappingPath = None,
    dbc: DbcPaths = None,
    vehicle: Annotated[Path | None, option("inspect --vehicle")] = None,
    every_way: Annotated[bool, option("inspect --all")] = False,
    json_path: Annotated[str | None, option("inspect --json")] = None,
    whole: Whole = False,
) -> None:
    """Show what a drive holds: signals, rates, gaps, problems, possible methods.

    A recording of several drives (such as a file of a whole day) is split as `weighbridge weigh`
    splits it. Each drive is shown.

    Example: weighbridge inspect drive/ --vehicle car.toml
    """
    from weighbridge.pipeline.inspection import inspect_drive
    from weighbridge.vehicle import Vehicle

    car = Vehicle.load(vehicle) if vehicle is not None else None
    chosen = chosen_mapping(car, vehicle, mapping)
    refuse_results(inputs(drives, vehicle, chosen, dbc), asked_for(json=json_path))
    screen = console(highlight=False)
    if not screen.is_terminal:
        screen.width = _WIDTH
    lines: list[str] = []
    for path in drives:
        parts = load_parts(path, chosen, dbc, whole=whole)
        found = [inspect_drive(drive, car) for drive in parts]
        lines += [one.to_json() for one in found]
        if json_path == "-":
            continue
        for one in found:
            _show(screen, one, every_way)
        best = next((one for one in found if _weighable(one)), found[0])
        for line in _next(best, path, len(parts), _Given(car, vehicle, mapping, dbc, whole)):
            say(line)
    write_json(json_path, "\n".join(lines))


class _Given(NamedTuple):
    """What the command was given beside the drives."""

    car: Vehicle | None
    vehicle: Path | None
    mapping: Path | None
    dbc: list[str] | None
    whole: bool

    def options(self, vehicle: Path | None = None) -> list[str]:
        """Options that the next command takes as this one did, perhaps of another vehicle file."""
        named = vehicle or self.vehicle
        return [
            *([f"--vehicle {named}"] if named is not None else []),
            *([f"--mapping {self.mapping}"] if self.mapping is not None else []),
            *(f"--dbc {d}" for d in self.dbc or ()),
            *(["--whole"] if self.whole else []),
        ]


def _weighable(found: Inspection) -> bool:
    serious = any(p.serious for p in found.problems)
    return not serious and any(w.possible and w.torque != "speed" for w in found.ways)


def _next(found: Inspection, path: Path, parts: int, given: _Given) -> list[str]:
    """Say what to type next, by whether the vehicle file weighs or has to be calibrated first."""
    from weighbridge.vehicle import by_data_sheet
    from weighbridge.vehicle.description import can_weigh

    if any(p.serious for p in found.problems):
        return ["next: settle what is serious above, then inspect again"]
    if not _weighable(found):
        return _what_lacks(found, path, given)
    car, base = given.car, None
    lines = []
    if car is None and _heavy(found):
        base = Path("base.toml")
        lines.append(f"next: {_new_vehicle(found, given, base)}: the log is none of a car")
    weighs = car is not None and can_weigh(car)
    if car is not None and weighs and not any(w.chosen for w in found.ways):
        return [_other_torque(found, car)]
    if weighs:
        lines.append(" ".join(["next: weighbridge weigh", str(path), *given.options()]))
    if car is None or not weighs or by_data_sheet(car):
        masses = (
            "--mass KG" if parts == 1 else " ".join(f"--mass KG{k}" for k in range(1, parts + 1))
        )
        lead = "better" if weighs else "then" if base is not None else "next"
        words = [f"{lead}: weighbridge calibrate", str(path), masses, "-o vehicle.toml"]
        # The new file names the mapping.
        left = given if base is None else given._replace(mapping=None)
        lines.append(" ".join([*words, *left.options(base)]))
    return lines


def _what_lacks(found: Inspection, path: Path, given: _Given) -> list[str]:
    """Say how to go on where no way to weigh is open: record more, or state what 100 % are."""
    from weighbridge.pipeline.inspection import DRIVEN_NEEDED, REFERENCE_NEEDED

    if found.ways[0].needs == (DRIVEN_NEEDED,) and given.vehicle is not None:
        return [f"next: state driven under [driveline] of {given.vehicle}, then inspect again"]
    if found.ways[0].needs not in ((REFERENCE_NEEDED,), (DRIVEN_NEEDED,)):
        return ["next: record what the nearest way lacks, or name its column in the mapping"]
    if given.vehicle is not None:
        return [
            f"next: state what 100 % of the torque are, reference_torque_nm under [torque] of "
            f"{given.vehicle}, then inspect again"
        ]
    base = Path("base.toml")
    # The new file names the mapping.
    options = " ".join(given._replace(mapping=None).options(base))
    if found.ways[0].needs == (DRIVEN_NEEDED,):
        return [
            f"next: {_new_vehicle(found, given, base)}, with the driven axles as AXLES: front, "
            "rear or all",
            f"then: weighbridge inspect {path} {options}",
        ]
    return [
        f"next: {_new_vehicle(found, given, base)}, with the torque that 100 % are as NM",
        f"then: weighbridge inspect {path} {options}",
    ]


def _new_vehicle(found: Inspection, given: _Given, base: Path) -> str:
    """Command that writes the vehicle file of a log, by the torque of its best way."""
    from weighbridge.vehicle import TORQUE_SOURCES
    from weighbridge.vehicle.torque_sources import MEASURED

    source = TORQUE_SOURCES[found.ways[0].torque]
    words = ["weighbridge vehicle new --class", "truck" if _heavy(found) else "car"]
    if source.signed and source.name != MEASURED:
        words.append(f"--torque {source.name}")
    if "reference_torque" in "".join(found.ways[0].needs):
        words.append("--reference-torque NM")
    elif found.ways[0].needs:
        words.append("--driven AXLES")
    words += [*given._replace(vehicle=None, dbc=None, whole=False).options(), f"-o {base}"]
    others = "bus, van" if _heavy(found) else "van, bus, truck"
    return f"{' '.join(words)} (or {others})"


def _other_torque(found: Inspection, car: Vehicle) -> str:
    """Say that a drive has its torque in another way than the vehicle file weighs by."""
    from weighbridge.vehicle import TORQUE_SOURCES

    reported, asked = TORQUE_SOURCES[found.ways[0].torque], car.torque.of_source
    remedy = f"make a vehicle file of it: calibrate --torque {reported.name}"
    if reported.signed:
        remedy += f", or vehicle new --torque {reported.name}"
    return (
        f"next: the vehicle file weighs by {asked.title}, and the drive holds {reported.title}; "
        f"{remedy}"
    )


def _heavy(found: Inspection) -> bool:
    """Whether a drive without a vehicle file seems to be of a truck or bus."""
    reference = found.drive.get("reference_torque")
    strong = reference is not None and len(reference) and float(reference.values.max()) > _STRONG
    by_j1939 = any(line.startswith("J1939") for line in found.drive.contents)
    return found.drive.has("retarder_torque") or by_j1939 or bool(strong)


def _show(screen: Console, found: Inspection, every_way: bool) -> None:
    from weighbridge.inertia.ride_checks import NEEDED as RIDE

    drive = found.drive
    screen.print(f"[bold]{shown(drive.name)}[/]: {drive.duration / 60.0:.1f} min")
    for line in drive.contents:
        screen.print(f"  {shown(line)}", soft_wrap=True)
    screen.print(_signal_table(found, screen.width))
    if found.problems:
        screen.print("Problems")
        for p in found.problems:
            mark = "[bold red]serious[/]" if p.serious else "note"
            screen.print(f"  {mark}: {shown(p.text)}", soft_wrap=True)
    else:
        screen.print("No problems found")
    weighable = any(w.possible and w.torque != "speed" for w in found.ways)
    if drive.has(*RIDE):
        screen.print("The ride is there: weighbridge inertia finds sprung mass and inertias")
        if not weighable:
            screen.print()
            return
    if not weighable:
        screen.print("No way to weigh by this drive; the nearest one:")
    screen.print(_way_table(found, every_way))
    screen.print()


def _signal_table(found: Inspection, width: int) -> Table:
    """List the signals; a narrow terminal gets the columns that matter most."""
    from rich.table import Table

    table = Table()
    columns = ["samples", "Hz", "period s", "jitter ms", "gaps", "longest s", "lowest", "highest"]
    columns += ["step"]
    rare = {"period s", "jitter ms", "longest s", "step"} if width < _WHOLE else set()
    if width < _NARROW:
        rare |= {"samples", "gaps"}
    kept = [c for c in columns if c not in rare]
    table.add_column("signal", no_wrap=True)
    for name in kept:
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("unit", no_wrap=True)
    for s in found.signals:
        cells = (
            str(s.count),
            _shown(s.rate, 4),
            _shown(s.period, 4),
            _shown(1e3 * s.jitter, 3),
            str(s.gaps),
            f"{s.longest_gap:.3g}" if s.gaps else "",
            f"{s.low:.5g}",
            f"{s.high:.5g}",
            f"{s.step:.3g}" if s.step is not None else "fine",
        )
        reported = dict(zip(columns, cells, strict=True))
        table.add_row(s.name, *(reported[c] for c in kept), s.unit)
    return table


def _shown(value: float, digits: int) -> str:
    """Text of a number; nothing of one that a single sample does not give."""
    return "" if math.isnan(value) else f"{value:.{digits}g}"


def _way_table(found: Inspection, every_way: bool) -> Table:
    from rich.table import Table

    ways = [w for w in found.ways if w.possible or every_way]
    if not any(w.torque != "speed" for w in ways):
        ways = [found.ways[0], *ways]
    table = Table()
    lacking = any(w.needs for w in ways)
    names = ["way to weigh by", "expect (one std)", "limited by"] + ["lacks"] * lacking
    for name in names:
        table.add_column(name)
    for w in ways:
        mark = " (weigh goes this way)" if w.chosen else ""
        known = (w.accuracy, w.because) if w.possible else ("", "")
        cells = (w.name + mark, *known, ", ".join(w.needs))
        table.add_row(*cells[: len(names)])
    return table
