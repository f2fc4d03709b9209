"""What a fleet teaches: scales of its vehicles, and files refined by its drives of known mass."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
import polars as pl

from weighbridge.errors import ConfigError, WeighbridgeError
from weighbridge.fleet.engine import WORKER_DIED, SchedulerLost, scheduler_needed
from weighbridge.fleet.inputs import Recording
from weighbridge.fleet.job import TRIES, drives_of, local_paths, named_error
from weighbridge.fleet.learnt import COLUMNS, LEARNT, SURE
from weighbridge.fleet.remote import by_url
from weighbridge.fleet.scales import Weighed, find_scales
from weighbridge.fleet.tickets import read_tickets, ticketed, with_tickets
from weighbridge.fleet.vehicles import Assigned, Vehicles
from weighbridge.io import PARSE_ERRORS, quietly
from weighbridge.messages import Problem
from weighbridge.pipeline.given import mapping_beside
from weighbridge.signals import Drive, Floats
from weighbridge.vehicle import Vehicle
from weighbridge.whole import whole_file

if TYPE_CHECKING:
    from distributed import Client

MOST: Final = 12
"""Drives that refine one vehicle file, at most: those over all masses, and over all of the time."""

FEW: Final = 4
"""Drives that show a drift, at least."""

MONTH: Final = 30 * 86_400.0
"""The time that drifts are reported for [s]."""

DRIFTS: Final = (
    ("torque_drift{}_pct", "torque scale", "%"),
    ("rolling_drift{}", "rolling resistance", ""),
    ("pitch_drift{}_deg", "pitch of the sensor", "deg"),
)
"""What is watched: the column with a place for ``_std``, its name, and its unit."""

APART: Final = 2.0
"""Masses contradict a vehicle file where they are off by so many standard deviations [-]."""


class Known(NamedTuple):
    """A drive of known mass: where it is, when it began, masses weighed and known [kg]."""

    paths: tuple[str, ...]
    part: int
    begin: datetime
    weighed: float
    std: float
    known: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Lesson:
    """What a worker needs to refine one vehicle: its file, its drives, and where the file goes."""

    assigned: Assigned
    drives: tuple[Known, ...]
    output: str
    whole: bool = False
    dbc: tuple[str, ...] = ()
    elevation: str | None = None


class Drift(NamedTuple):
    """Change per 30 days and its standard deviation; NaN where too few drives show it."""

    slope: float
    std: float

    @property
    def sure(self) -> bool:
        """Whether it is more than the scatter."""
        return abs(self.slope) > SURE * self.std


def learn_fleet(
    client: Client,
    results: Path,
    shelf: Vehicles,
    tickets: Path | None,
    output: Path,
    *,
    whole: bool,
    dbc: Sequence[str] = (),
    elevation: str | None = None,
) -> pl.DataFrame:
    """Find the scales of a fleet's vehicles, and refine their files where there are tickets.

    Parameters
    ----------
    client : of a Dask cluster
    results : folder of weighed drives
    shelf : the vehicle files
    tickets : table of them; None where there is none, and no file is refined
    output : folder of the refined files, none of the old ones
    whole, dbc, elevation : as the drives were weighed

    Returns
    -------
    One row per vehicle, see `learn_vehicle` and `learn_scales`; it is also in the results as
    ``learnt.parquet``

    Raises
    ------
    ConfigError
        Tickets cannot be read, or the folder not be written to.
    SchedulerLost
        The scheduler is gone.
    """
    from weighbridge.fleet.reading import read_drives

    refuse_output(output, shelf)
    rows: list[dict[str, Any]] = []
    if tickets is not None:
        found = ticketed(read_tickets(tickets), read_drives(results))
        output.mkdir(parents=True, exist_ok=True)
        lessons = []
        for (vehicle,), own in found.partition_by("vehicle_id", as_dict=True).items():
            assigned = shelf.of((str(vehicle),), str(vehicle))
            if assigned.vehicle is not None:
                known = tuple(_known(row) for row in own.iter_rows(named=True))
                lessons.append(
                    Lesson(
                        assigned=assigned,
                        drives=known,
                        output=str(output.resolve()),
                        whole=whole,
                        dbc=tuple(dbc),
                        elevation=elevation,
                    )
                )
        with scheduler_needed(client):
            rows = _learnt(client, lessons)
    return learn_scales(results, shelf, tickets, rows)


def learn_scales(
    results: Path,
    shelf: Vehicles,
    tickets: Path | None = None,
    refined: Sequence[Mapping[str, Any]] = (),
) -> pl.DataFrame:
    """Find the scales of the vehicles that have a file, see `weighbridge.fleet.scales`.

    Drives that were weighed with another file of their vehicle do not count.

    Parameters
    ----------
    results : folder of weighed drives
    shelf : the vehicle files
    tickets : table of them; None where there is none
    refined : rows of `learn_vehicle`

    Returns
    -------
    polars.DataFrame
        One row per vehicle with the columns `weighbridge.fleet.learnt.COLUMNS`; it is also in the
        results as ``learnt.parquet``.

    Raises
    ------
    ConfigError
        Tickets cannot be read, or the results not be written to.
    """
    from weighbridge.fleet.legs import legs
    from weighbridge.fleet.reading import collected, read_drives, read_segments

    drives, segments = (collected(read(results), results) for read in (read_drives, read_segments))
    digests = {path.stem: shelf.of((), path.stem).digest for path in shelf.files}
    rows = legs(drives, segments).join(
        drives.select("key", "part", "vehicle_digest"), on=["key", "part"]
    )
    current = pl.DataFrame(
        list(digests.items()), schema={"vehicle_id": pl.String, "vehicle_digest": pl.String},
        orient="row",
    )  # fmt: skip
    rows = rows.join(current, on=["vehicle_id", "vehicle_digest"], how="semi")
    rows = rows.filter(pl.col("mass_kg") > 0.0).drop_nulls(["std_kg", "shared_kg"])
    reported = [] if tickets is None else read_tickets(tickets)
    known = with_tickets(rows, reported).select("key", "part", "leg", "ticket_kg")
    rows = rows.join(known, on=["key", "part", "leg"], how="left")
    fleet = [
        _weighed(str(vehicle), car, own)
        for (vehicle,), own in rows.partition_by("vehicle_id", as_dict=True).items()
        if (car := shelf.of((), str(vehicle)).vehicle) is not None
    ]
    scales = pl.DataFrame(
        [
            {
                "vehicle_id": scale.vehicle,
                "vehicle_digest": digests[scale.vehicle],
                "type": scale.type,
                "factor": scale.factor,
                "factor_std": scale.std,
                "factor_common_std": scale.common_std,
                "factor_legs": scale.legs,
                "factor_reason_id": scale.reason.id,
                "factor_reason": scale.reason.text,
            }
            for scale in find_scales(fleet)
        ],
        schema={name: COLUMNS[name] for name in ("vehicle_id", *_OF_SCALE)},
    )
    taught = pl.DataFrame(list(refined), schema=COLUMNS, orient="row").drop(_OF_SCALE)
    frame = taught.join(scales, on="vehicle_id", how="full", coalesce=True)
    frame = frame.with_columns(pl.col("drives", "weighed").fill_null(0)).select(list(COLUMNS))
    frame = frame.sort("vehicle_id")
    path = results / LEARNT
    # Written only where it changed: the legs are made anew after it.
    if not _holds(path, frame):
        with whole_file(path) as part:
            frame.write_parquet(part)
    return frame


def _holds(path: Path, frame: pl.DataFrame) -> bool:
    """Say whether a file has this table; one that is damaged has not."""
    try:
        with path.open("rb") as file, quietly():
            return pl.read_parquet(file).equals(frame)
    except (*PARSE_ERRORS, OSError):
        return False


_OF_SCALE: Final = tuple(COLUMNS)[list(COLUMNS).index("vehicle_digest") :]


def _weighed(name: str, car: Vehicle, rows: pl.DataFrame) -> Weighed:
    """Return what a vehicle's legs show of its scale.

    Vehicles of one type, or of one class where their files name none, share their errors. Those
    whose torque was calibrated share them among themselves.
    """
    mass, std, shared, known = (
        rows[name].fill_null(math.nan).to_numpy()
        for name in ("mass_kg", "std_kg", "shared_kg", "ticket_kg")
    )
    calibrated = car.provenance.mass_scale_std is not None
    tare = math.nan if car.tare is None else car.tare
    return Weighed(
        vehicle=name,
        type=f"{car.type or car.kind}{', calibrated' if calibrated else ''}",
        mass=mass,
        own=np.sqrt(np.maximum(std**2 - shared**2, 0.0)) / mass,
        known=known,
        shared=float(np.median(shared / mass)),
        tare=tare,
        gross=tare * car.of_class.loaded if car.gross is None else car.gross,
        emptied=car.of_class.emptied,
    )


def _learnt(client: Client, lessons: Sequence[Lesson]) -> list[dict[str, Any]]:
    """Return a row of each vehicle, also of one whose worker died.

    One whose worker died is tried again when the others are done, alone, so that it takes no other
    with it.
    """
    rows, suspects = _tried(client, lessons)
    for lesson in suspects:
        for _ in range(TRIES - 1):
            own, again = _tried(client, [lesson])
            rows += own
            if not again:
                break
        else:
            rows.append(_unlearnt(lesson, WORKER_DIED))
    return rows


def _tried(client: Client, lessons: Sequence[Lesson]) -> tuple[list[dict[str, Any]], list[Lesson]]:
    """Return a row of each vehicle but of those whose worker died, and the lessons of these."""
    from distributed import as_completed
    from distributed.scheduler import KilledWorker

    futures = client.map(learn_vehicle, lessons, pure=False)
    given = dict(zip((future.key for future in futures), lessons, strict=True))
    rows, killed = [], []
    try:
        for future in as_completed(futures, loop=client.loop):
            lesson = given[future.key]
            if future.status in ("cancelled", "lost"):
                raise SchedulerLost
            try:
                rows.append(future.result())
            except KilledWorker:
                killed.append(lesson)
            except Exception as problem:
                if future.status != "error":
                    raise
                rows.append(_unlearnt(lesson, named_error(problem)))
    finally:
        if client.status == "running":
            client.cancel(futures, force=True)
    return rows, killed


def _unlearnt(lesson: Lesson, why: str) -> dict[str, Any]:
    weighed = sum(math.isfinite(known.weighed) for known in lesson.drives)
    return {
        "vehicle_id": lesson.assigned.id,
        "drives": len(lesson.drives),
        "weighed": weighed,
        "findings": f"nothing was learnt: {why}",
    }


def refuse_output(output: Path, shelf: Vehicles) -> None:
    """Raise where refined files would take the place of those that are read.

    Raises
    ------
    ConfigError
        The folder is that of the vehicle files, or holds a file of another kind by such a name.
    """
    for path in shelf.files:
        target = output / path.name
        if not target.exists():
            continue
        if target.samefile(path):
            raise ConfigError(
                f"{output}: holds the vehicle files that are read; name another folder for --learn"
            )
        # An earlier one is replaced; anything else is shown by this.
        Vehicle.load(target)


def learn_vehicle(lesson: Lesson) -> dict[str, Any]:
    """Refine one vehicle file, and say whether its drives contradict it, and what drifts.

    Parameters
    ----------
    lesson

    Returns
    -------
    A row of `COLUMNS`; nothing is raised for drives that cannot be used
    """
    from weighbridge.calibration import calibrate

    car, reported = lesson.assigned.vehicle, []
    weighed = [k for k in lesson.drives if math.isfinite(k.weighed)]
    row: dict[str, Any] = {
        "vehicle_id": lesson.assigned.id,
        "drives": len(lesson.drives),
        "weighed": len(weighed),
    }
    error, std = _mean_error(weighed)
    row |= {"error_pct": 100.0 * error, "error_std_pct": 100.0 * std}
    row["contradicted"] = len(weighed) > 1 and abs(error) > APART * std
    if row["contradicted"]:
        reported.append(
            f"{len(weighed)} drives of known mass contradict the vehicle file: in the mean they "
            f"come out {abs(100.0 * error):.1f} % too {'heavy' if error > 0 else 'light'}, and "
            f"their standard deviation is {100.0 * std:.1f} %"
        )
    drives, masses, alone, times = [], [], [], []
    for known in chosen(lesson.drives):
        try:
            drive = _read(lesson, known)
            one = calibrate([drive], [known.known], vehicle=car)
        except (WeighbridgeError, OSError) as problem:
            reported.append(
                f"{Path(known.paths[0]).name} cannot be learnt from: "
                f"{by_url(str(problem), known.paths)}"
            )
            continue
        drives.append(drive)
        masses.append(known.known)
        times.append(known.begin)
        mounting = one.mounting.pitch if one.mounting is not None else math.nan
        alone.append((one.road.rolling_coefficient.value, math.degrees(mounting)))
    changes = _drifts(weighed, times, np.array(alone, dtype=float).reshape(-1, 2))
    row |= _columns(changes)
    reported += [text for text in map(_drift_text, DRIFTS, changes) if text]
    if drives:
        try:
            refined = with_drift(calibrate(drives, masses, vehicle=car), changes[0], times)
            name = f"{lesson.assigned.id}.toml"
            target = Path(lesson.output) / name
            if refined.mapping is not None and lesson.assigned.mapping_file is not None:
                named = mapping_beside(Path(lesson.assigned.mapping_file), target)
                refined = replace(refined, mapping=named)
            refined.save(target)
            row["refined"] = name
        except WeighbridgeError as problem:
            reported.append(f"the file cannot be refined: {problem}")
    return row | {"findings": "; ".join(reported)}


def chosen(drives: Sequence[Known]) -> list[Known]:
    """Return at most `MOST` drives, in order of time: evenly over the order of their masses."""
    if len(drives) <= MOST:
        return list(drives)
    by_mass = sorted(drives, key=lambda k: (k.known, k.begin))
    places = np.linspace(0, len(by_mass) - 1, MOST).round().astype(int)
    return sorted((by_mass[k] for k in places), key=lambda k: k.begin)


def _mean_error(weighed: Sequence[Known]) -> tuple[float, float]:
    """Mean of the relative errors, and how far they may be off together.

    What a vehicle file leaves uncertain is the same in all its drives: the mean is no surer than
    one.
    """
    if not weighed:
        return math.nan, math.nan
    errors = np.array([k.weighed / k.known - 1.0 for k in weighed])
    stds = np.array([k.std / k.known for k in weighed])
    return float(errors.mean()), float(np.sqrt(np.mean(np.square(stds))))


def _drifts(
    weighed: Sequence[Known], times: Sequence[datetime], alone: Floats
) -> tuple[Drift, ...]:
    """Find what changes with time, in the order of `DRIFTS`."""
    scales = np.array([100.0 * (k.weighed / k.known - 1.0) for k in weighed])
    return (
        drift([k.begin for k in weighed], scales),
        drift(times, alone[:, 0]),
        drift(times, alone[:, 1]),
    )


def _columns(changes: Sequence[Drift]) -> dict[str, float]:
    row = {}
    for (column, _, _), change in zip(DRIFTS, changes, strict=True):
        row[column.format("")], row[column.format("_std")] = change
    return row


def _drift_text(watched: tuple[str, str, str], change: Drift) -> str:
    """Say what drifts; empty where nothing does for sure."""
    _, what, unit = watched
    if not change.sure:
        return ""
    return f"the {what} drifts by {change.slope:+.2g} {unit} (std {change.std:.1g}) in 30 days"


def with_drift(refined: Vehicle, change: Drift, times: Sequence[datetime]) -> Vehicle:
    """Count a drift of the torque scale in what a refined file leaves uncertain, and note it.

    The file holds the mean of its drives. Where the scale changes by d over their time, the next
    drives, which the file is for, are at least ``d / 2`` off.

    Parameters
    ----------
    refined : calibrated by drives that begin at ``times``
    change : of the torque scale [%]
    times
    """
    from weighbridge.calibration.fitted import noted

    if not change.sure or len(times) < 2:
        return refined
    months = (max(times) - min(times)).total_seconds() / MONTH
    std = 0.5 * 0.01 * abs(change.slope) * months
    drifts = Problem.of("calibration.drifts", drifts=_drift_text(DRIFTS[0], change))

    def wider(one: Vehicle) -> Vehicle:
        left = math.hypot(one.provenance.mass_scale_std or 0.0, std)
        made = replace(one.provenance, mass_scale_std=left)
        return noted(replace(one, provenance=made), drifts)

    other = refined.without_accelerometer
    return replace(wider(refined), without_accelerometer=wider(other) if other else None)


def drift(times: Sequence[datetime], values: Floats) -> Drift:
    """Fit a line over time.

    Parameters
    ----------
    times : of the values
    values : (n,); NaN where there is none

    Returns
    -------
    Slope per 30 days, with a standard deviation from the scatter around the line
    """
    good = np.isfinite(values)
    if np.count_nonzero(good) < FEW:
        return Drift(math.nan, math.nan)
    day = np.array([t.timestamp() for t, g in zip(times, good, strict=True) if g]) / MONTH
    day -= day.mean()
    spread = float(day @ day)
    if spread <= 0.0:
        return Drift(math.nan, math.nan)
    own = values[good] - values[good].mean()
    slope = float(day @ own) / spread
    left = own - slope * day
    return Drift(slope, float(np.sqrt(left @ left / (left.size - 2) / spread)))


def _known(row: Mapping[str, Any]) -> Known:
    return Known(
        paths=tuple(row["source"].split(";")),
        part=row["part"],
        begin=row["begin"],
        weighed=math.nan if row["mass_kg"] is None else row["mass_kg"],
        std=math.nan if row["std_kg"] is None else row["std_kg"],
        known=row["ticket_kg"],
    )


def _read(lesson: Lesson, known: Known) -> Drive:
    with local_paths(Recording(known.paths)) as paths:
        held = drives_of(
            paths,
            lesson.assigned.mapping,
            lesson.dbc,
            whole=lesson.whole,
            elevation=lesson.elevation,
        )
        return held[known.part]
