"""``weighbridge live``: the mass while the vehicle drives."""

from __future__ import annotations

import math
from pathlib import Path
from threading import Event
from typing import TYPE_CHECKING, Annotated

import typer

from weighbridge.cli.listed import option, source_kinds
from weighbridge.cli.options import (
    DbcPaths,
    KeepDays,
    MappingPath,
    SplitMb,
    Units,
    chosen_mapping,
    load,
)
from weighbridge.cli.results import (
    Result,
    asked_for,
    inputs,
    refuse_missing_folder,
    refuse_overwriting,
    refuse_results,
)
from weighbridge.cli.terminal import complain, console, ended_by_signals, say
from weighbridge.cli.verbosity import notice, quiet

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from weighbridge.live import (
        Alert,
        Keeper,
        LiveScale,
        LiveWeighing,
        OrderFile,
        Output,
        Recordings,
        Session,
        Source,
    )
    from weighbridge.signals import DriveInfo
    from weighbridge.vehicle import Vehicle

_NO_STATE = "none"


def live(
    vehicle: Annotated[Path, option("--vehicle")],
    source: Annotated[
        list[str] | None, option("live --source", autocompletion=source_kinds)
    ] = None,
    replay: Annotated[Path | None, option("live --replay")] = None,
    rate: Annotated[str, option("live --rate")] = "1",
    json_path: Annotated[str | None, option("live --json")] = None,
    mqtt: Annotated[str | None, option("live --mqtt")] = None,
    page: Annotated[str | None, option("live --page")] = None,
    record: Annotated[Path | None, option("live --record")] = None,
    split_mb: SplitMb = None,
    keep_days: KeepDays = None,
    every: Annotated[float, option("live --every")] = 1.0,
    above: Annotated[float | None, option("live --above")] = None,
    below: Annotated[float | None, option("live --below")] = None,
    ticket: Annotated[float | None, option("live --ticket")] = None,
    out: Annotated[Path | None, option("live --out")] = None,
    state: Annotated[str | None, option("live --state")] = None,
    orders: Annotated[Path | None, option("live --orders")] = None,
    lateness: Annotated[float, option("live --lateness")] = 1.0,
    listen_only: Annotated[bool, option("live --listen-only")] = False,
    force: Annotated[bool, option("live --force")] = False,
    units: Units = "si",
    mapping: MappingPath = None,
    dbc: DbcPaths = None,
) -> None:
    """Weigh a vehicle while it drives.

    Keys on a terminal: t tares, l says that the load has changed, q ends. Without a terminal use
    --orders. Exit status: 0 if there is a mass at the end, 1 if there is none.

    Example: weighbridge live --vehicle car.toml --replay drive/ --rate 20
    """
    import logging

    from weighbridge.errors import ConfigError
    from weighbridge.live import Feed, Outputs, Session, order_file
    from weighbridge.live.clock import at_rate
    from weighbridge.live.orders import keys
    from weighbridge.vehicle import Vehicle

    _refuse_options(source, replay, every, ticket, out)
    if record is None and (split_mb is not None or keep_days is not None):
        raise ConfigError("--split-mb and --keep-days are for a recording: give --record DRIVE")
    car = Vehicle.load(vehicle)
    chosen = chosen_mapping(car, vehicle, mapping)
    kept = _state_file(state, replay, vehicle)
    if ticket is not None and out is None:
        out = _free_file(vehicle)
        notice(f"the ticket writes {out}")
    named = kept if state is not None or kept == vehicle else None
    read = inputs([replay] if replay is not None else [], vehicle, chosen, dbc)
    refuse_results(read, _results(json_path, out, named, force=force))
    logging.basicConfig(format="%(message)s", level=logging.WARNING)
    alerts = _alerts(above, below, car)
    speed = _speed(rate, replayed=replay is not None)
    sources, info, start = _sources(source or (), replay, speed, chosen, dbc, listen_only)
    scale, keeper = _scale(
        car, kept, lateness, info, start, _step(replay, speed),
        by_host=replay is None and speed == 1.0,
    )  # fmt: skip
    with (
        at_rate(1.0 if replay is not None else speed),
        keys(wanted=not any(s.name == "lines:-" for s in sources)) as pressed,
        Outputs(_outputs(json_path, mqtt, page, car, vehicle, alerts)) as outputs,
        Feed(sources) as feed,
        order_file(orders) as ordered,
    ):
        session = Session(
            feed=feed,
            scale=scale,
            outputs=outputs,
            period=every,
            keeper=keeper,
            recorder=None if record is None else _recorder(record, info, split_mb, keep_days),
            alerts=alerts,
            ahead=not _unwatched(replay, speed),
            aside=replay is None,
        )
        last = _run(session, pressed, ordered)
    if ticket is not None and out is not None:
        _calibrate(scale, ticket, car, out)
    _conclude(last, aloud=json_path != "-")


def _refuse_options(
    source: list[str] | None,
    replay: Path | None,
    every: float,
    ticket: float | None,
    out: Path | None,
) -> None:
    """Refuse options that do not go together."""
    from weighbridge.errors import ConfigError

    if ticket is None and out is not None:
        raise ConfigError(f"-o {out}: without --ticket KG no vehicle file is written")
    if not every > 0.0:
        raise ConfigError(f"--every {every:g}: give seconds above 0")
    if bool(source) == (replay is not None):
        raise ConfigError("give --source KIND:PLACE once or more, or --replay DRIVE")


def _results(
    json: str | None, out: Path | None, state: Path | None, *, force: bool
) -> list[Result]:
    """Files that are to be written; a vehicle file is refused where it would be overwritten."""
    results = asked_for(json=json)
    if out is not None:
        refuse_overwriting(out, force, "vehicle file")
        results.append(Result("--out", out, "vehicle file"))
    if state is not None:
        results.append(Result("--state", state, "state"))
    return results


def _conclude(last: LiveWeighing, *, aloud: bool) -> None:
    """Say the mass at the end; exit with 1 where there is none."""
    if math.isnan(last.mass):
        complain(f"{last.status}: {last.reason}")
        raise typer.Exit(1)
    if aloud:
        from weighbridge.report.text import between, kg

        low, high = last.interval()
        say(f"{kg(last.mass)}, {between(low, high)} with 95 % probability")


def _sources(
    texts: Sequence[str],
    replay: Path | None,
    speed: float,
    mapping: Path | None,
    dbc: list[str] | None,
    listen_only: bool,
) -> tuple[list[Source], DriveInfo, float]:
    """Make the sources; return what is known beside their samples, and when they begin [s]."""
    from weighbridge.live import Replay
    from weighbridge.signals import DriveInfo

    if replay is None:
        from weighbridge.live import parse_source
        from weighbridge.live.clock import now

        made = [
            parse_source(text, dbc=dbc or (), mapping=mapping, listen_only=listen_only)
            for text in texts
        ]
        return made, DriveInfo(), now()
    drive = load(replay, mapping, dbc)
    return [Replay(drive, speed)], drive.info, drive.start


def _speed(rate: str, *, replayed: bool) -> float:
    """Read a rate: seconds of the drive per second."""
    from weighbridge.errors import ConfigError

    try:
        speed = math.inf if rate == "max" else float(rate)
    except ValueError:
        raise ConfigError(f"--rate {rate}: give 1 as recorded, 10 for tenfold, or max") from None
    if not replayed and not 0.0 < speed < math.inf:
        raise ConfigError(f"--rate {rate}: sources have that of weighbridge emulate, such as 5")
    if not replayed and speed != 1.0:
        complain(f"the clock goes at {speed:g} times its rate: only emulated sources do, too")
    return speed


def _unwatched(replay: Path | None, speed: float) -> bool:
    """Whether nobody waits for what is shown: a replay on its fastest way."""
    return replay is not None and math.isinf(speed)


def _step(replay: Path | None, speed: float) -> float:
    """Choose the step of the scale [s]."""
    from weighbridge.signals import LONGEST_STEP, STEP

    return LONGEST_STEP if _unwatched(replay, speed) else STEP


def _state_file(state: str | None, replay: Path | None, vehicle: Path) -> Path | None:
    """Choose the file that keeps the state; None for none."""
    if state is not None:
        return None if state == _NO_STATE else Path(state)
    return None if replay is not None else vehicle.with_suffix(".state")


def _scale(
    car: Vehicle,
    state: Path | None,
    lateness: float,
    info: DriveInfo,
    start: float,
    step: float,
    *,
    by_host: bool,
) -> tuple[LiveScale, Keeper | None]:
    """Go on from the state that was kept, or begin anew."""
    from weighbridge.live import Keeper, LiveScale

    if state is None:
        return LiveScale(car, lateness=lateness, info=info, step=step), None
    refuse_missing_folder(state)
    keeper = Keeper(state)
    scale, found = keeper.restored(
        car, lateness=lateness, info=info, start=start, step=step, by_host=by_host
    )
    if found:
        complain(found)
    return scale, keeper


def _free_file(vehicle: Path) -> Path:
    """Name a vehicle file beside another that is not there yet: ``car-ticket.toml``."""
    found, number = vehicle.with_stem(f"{vehicle.stem}-ticket"), 1
    while found.exists():
        number += 1
        found = vehicle.with_stem(f"{vehicle.stem}-ticket-{number}")
    return found


def _recorder(folder: Path, info: DriveInfo, split: float | None, keep: float | None) -> Recordings:
    """Record into a folder, or beside it where it holds a drive: a service starts again."""
    from weighbridge.live.recordings import recordings

    made = recordings(folder, info, split_mb=split, keep_days=keep)
    if made.folders != [folder]:
        complain(f"{folder} holds something and stays as it is: recorded into {made.folders[0]}")
    return made


def _outputs(
    json_path: str | None,
    mqtt: str | None,
    page: str | None,
    car: Vehicle,
    vehicle: Path,
    alerts: Sequence[Alert],
) -> list[Output]:
    """Make the outputs that were asked for; the terminal's view begins when all others stand."""
    from weighbridge.live import Lines
    from weighbridge.live.outputs.terminal import terminal

    made: list[Output] = []
    if json_path is not None:
        made.append(Lines(json_path))
    if mqtt is not None:
        from weighbridge.live import Mqtt, parse_broker

        sides = [alert.side for alert in alerts]
        outbox = vehicle.with_suffix(".outbox")
        made.append(Mqtt(parse_broker(mqtt), car.name, outbox, sides=sides))
    if page is not None:
        from weighbridge.live import Page

        shown = Page(*_address(page))
        notice(f"page: {shown.name}")
        made.append(shown)
    return made if quiet() else [*made, terminal(console(stderr=True))]


def _address(text: str) -> tuple[str, int]:
    """Part ``[HOST:]PORT``; without a host this computer alone is served."""
    from weighbridge.errors import ConfigError

    host, _, port = text.rpartition(":")
    if not (port.isascii() and port.isdigit() and int(port) < 65536):
        raise ConfigError(f"--page {text}: give a port such as 8080, or HOST:PORT")
    return host.strip("[]") or "127.0.0.1", int(port)


def _alerts(above: float | None, below: float | None, car: Vehicle) -> list[Alert]:
    from weighbridge.live import Alert

    above = car.gross if above is None else above
    return [
        Alert(limit, above=over)
        for limit, over in ((above, True), (below, False))
        if limit is not None
    ]


def _run(session: Session, pressed: Callable[[], str], ordered: OrderFile | None) -> LiveWeighing:
    """Weigh until the sources end, somebody says so, or the process is asked to end."""
    from weighbridge.live import order
    from weighbridge.live.orders import END, ORDER_OF

    stop = Event()

    def orders(scale: LiveScale) -> None:
        words = [ORDER_OF[key] for key in pressed() if key in ORDER_OF]
        for word in [*words, *(ordered.read() if ordered is not None else ())]:
            if word == END:
                stop.set()
            else:
                complain(order(scale, word))

    session.orders = orders
    with ended_by_signals(stop):
        return session.run(stop)


def _calibrate(scale: LiveScale, ticket: float, car: Vehicle, out: Path) -> None:
    """Calibrate by the mass of a weighbridge; write the vehicle file unless it is a worse one."""
    from weighbridge.live.ticket import calibrated_by_ticket

    found = calibrated_by_ticket(scale.recorded(), ticket, car)
    if found.vehicle is None:
        complain(f"{out} is not written: {found.reported}")
        return
    found.vehicle.save(out)
    complain(f"written: {out}; {found.reported}")
