"""Du et al. 2025: bus mass by robust least squares, Kalman filter and their blend.

J. Du, Q. Wang, X. Yuan: Estimating bus mass using a hybrid approach: integrating
forgetting factor recursive least squares with the extended Kalman filter,
Sensors 25(6), 2025, 1741.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Final

import numpy as np

from weighbridge.balance import ForceBalance
from weighbridge.calibration import run_calibration
from weighbridge.estimators import MassTrack, hybrid
from weighbridge.estimators.hybrid import Blend, HybridSettings
from weighbridge.kernels.hybrid_mass import share_at
from weighbridge.papers.claims import Conditions, Found, Item, items_of, read_rows, same
from weighbridge.papers.du2025_bus import LOADS, data_sheet, known_bus, simulate
from weighbridge.papers.du2025_claims import JUDGES, paper_work, work
from weighbridge.papers.du2025_equations import equations
from weighbridge.papers.du2025_methods import (
    BAND,
    COLOURS,
    FORMS,
    METHODS,
    PAPER_RMSE,
    PAPER_TIME,
    PRINTED,
    READINGS,
    Settings,
    setting_rows,
)
from weighbridge.papers.du2025_results import CONVERGED as CONVERGED
from weighbridge.papers.du2025_results import (
    DriveResult,
    Opposite,
    Reproduction,
    cell,
    running_error,
    steady_from,
)
from weighbridge.papers.reproduced import Progress, Reproduced, rms
from weighbridge.pipeline.weighing import weigh
from weighbridge.report.style import BLUE, GREY, VERMILLION, Panel, blank, line
from weighbridge.report.table import Table
from weighbridge.signals import Floats, from_si
from weighbridge.vehicle import Vehicle, wheel_efficiency

if TYPE_CHECKING:
    from pathlib import Path

    from weighbridge.simulation import SimulatedDrive

_TABLES: Final = "`papers/du2025.py`"
_COMMAND: Final = "weighbridge reproduce du2025"


def _masses() -> tuple[Item, ...]:
    """Table 2, by the printed settings and by ours."""
    near = "10 % of print: another simulator, other tyres and another draw of the noise"
    rows = []
    for load, theirs in PAPER_RMSE.items():
        for method, rmse in zip(METHODS, theirs, strict=True):
            name = f"{method} {load}"
            rows.append(
                Item(item="table 2", what=f"RMSE, {name}", where=_TABLES,
                     printed=f"{rmse:.0f} kg", ours=f"{{{name}}}", tolerance=near)
            )  # fmt: skip
            rows += [
                Item(item="table 2", what=f"RMSE, {name}, {words}", where=_TABLES,
                     conditions=Conditions.OURS, printed=f"{rmse:.0f} kg",
                     ours=f"{{{name} {code}}}", tolerance="not above print", why=why,
                     check=check, seen=seen)
                for code, words, why, check, seen in (
                    ("ours", "tyres' f known", "our filters, which know the tyres' resistance", "",
                     ""),
                    ("road", "all effects, calibrated", "the zero of the accelerometer, wind, "
                     "cold tyres and accessories are unknown, which they are not in the paper",
                     _COMMAND, "the row above, where they are known"),
                )
            ]  # fmt: skip
    return tuple(rows)


def _times() -> tuple[Item, ...]:
    """Table 2, computing time."""
    return tuple(
        Item(item="table 2", what=f"computing time, {load}, {method}", where=_TABLES,
             conditions=Conditions.OURS, printed=f"{seconds:.1f} s",
             ours=f"{{time {method} {load}}}", tolerance="not above print: another computer")
        for load, times in PAPER_TIME.items()
        for method, seconds in zip(METHODS, times, strict=True)
    )  # fmt: skip


_ROWS: Final = read_rows(
    "du2025",
    work=paper_work(),
    loads=" / ".join(f"{blend:.0f}" for *_, blend in PAPER_RMSE.values()) + " kg",
    **{
        load.replace("-", "_"): f"{blend:.0f} of {least:.0f} and {kalman:.0f} kg"
        for load, (least, kalman, blend) in PAPER_RMSE.items()
    },
)

ITEMS: Final = (
    *items_of(_ROWS["equations"]), *items_of(_ROWS["figures"]), *_masses(), *_times(),
    *items_of(_ROWS["texts"]), *items_of(_ROWS["blends"]),
)  # fmt: skip
"""In the paper's order: equations, figures, tables, and what the text says."""


def panels(done: Reproduction) -> tuple[Panel, ...]:
    """Draw figs. 4 to 7 of the paper from our data."""
    drawn = []
    first = {d.load: d for d in reversed(done.drives)}
    for number, load in enumerate(LOADS):
        d = first[load]
        letter = "a" if number == 0 else ""
        for form in FORMS:
            drawn.append(
                mass_panel(
                    d.printed_tracks[form.code],
                    f"Fig. {5 + number}{letter}: mass, {load}, {form.name}",
                    f"Running mass of the paper's three filters, seed {d.seed}; true mass "
                    f"{d.true_mass:.0f} kg, dotted at 10 % of it.",
                    true_mass=d.true_mass,
                )
            )
        drawn.append(
            mass_panel(
                d.tracks,
                f"The same drive by our filters: mass, {load}",
                f"Running mass of the three methods, rolling of the tyres given, seed {d.seed}.",
                true_mass=d.true_mass,
            )
        )
    empty = first["no-load"].tracks["hybrid"].balance
    drawn += motion_panels(empty)
    drawn.append(share_panel())
    for d in done.road[:: max(1, len(done.road) // len(LOADS))]:
        drawn.append(
            mass_panel(
                d.tracks,
                f"With all effects: mass, {d.load}",
                f"The same as figs. 5 to 7 on a simulated road, the bus calibrated; seed {d.seed}.",
                true_mass=d.true_mass,
            )
        )
    return tuple(drawn)


def mass_panel(
    tracks: dict[str, MassTrack], title: str, caption: str, *, true_mass: float | None = None
) -> Panel:
    """Draw the running masses of some methods."""
    figure = blank("time s", "mass kg")
    for name, track in tracks.items():
        rows = slice(None, None, max(1, track.time.size // 1500))
        line(figure, track.time[rows], track.running_mass[rows], name, COLOURS.get(name, GREY))
    if true_mass is not None:
        ends = [float(x) for x in next(iter(tracks.values())).time[[0, -1]]]
        line(figure, ends, [true_mass, true_mass], "true", VERMILLION, dash="dash")
        for factor in (1.0 - BAND, 1.0 + BAND):
            level = factor * true_mass
            line(figure, ends, [level, level], "10 %", GREY, dash="dot", showlegend=factor < 1.0)
        figure.update_layout(yaxis_range=[0.8 * true_mass, 1.2 * true_mass])
    return Panel(title=title, caption=caption, figure=figure)


def motion_panels(balance: ForceBalance) -> list[Panel]:
    """Draw torque, speed and acceleration of a drive."""
    table = balance.table
    rows = slice(None, None, max(1, table.time.size // 1500))
    drawn = []
    for letter, name, unit, values in (
        ("b", "Engine torque", "N m", table.torque),
        ("c", "Speed", "km/h", from_si(table.speed, "kmh")),
        ("d", "Acceleration", "m/s²", table.accel),
    ):
        figure = blank("time s", f"{name.lower()} {unit}", height=300)
        line(figure, table.time[rows], values[rows], name.lower(), BLUE)
        drawn.append(
            Panel(title=f"Fig. 5{letter}: {name.lower()}", caption="No-load.", figure=figure)
        )
    return drawn


def share_panel() -> Panel:
    """Draw h(v)."""
    from weighbridge.kernels.hybrid_mass import share_at

    both = hybrid.HybridSettings()
    speed = np.linspace(0.0, 25.0, 126)
    share = [share_at(v, both.blend_speed, both.blend_width) for v in speed]
    figure = blank("speed km/h", "share of the least squares", height=300)
    line(figure, from_si(speed, "kmh"), share, "h(v)", BLUE)
    return Panel(
        title="Fig. 4: h(v)",
        caption="Our logistic curve; the paper's is only drawn.",
        figure=figure,
    )


SEED: Final = 171_000
"""Of the drives that are judged; none of them was seen when anything was chosen."""

TUNED: Final = frozenset((*range(2000, 2612), *range(3000, 3003), *range(170_000, 170_020)))
"""Seeds that settings were chosen on."""

SETTINGS: Final = Settings
"""Of `reproduced`, its third argument."""

DRIVES: Final = 3
"""Drives judged at each load."""

CALIBRATION_SEED: Final = 1_000_000
"""Added to the seed of the judged drives for those of the calibration."""

CALIBRATION_DRIVES: Final = 2
"""Drives of known mass at each load that the bus is calibrated on."""


def judge(
    load: str,
    made: SimulatedDrive,
    vehicle: Vehicle,
    *,
    printed: bool = False,
    settings: Settings | None = None,
) -> DriveResult:
    """Weigh one drive by all methods and compare with the truth.

    Parameters
    ----------
    load : of `LOADS`
    made, vehicle
    printed : run the methods as printed, too
    settings : of our methods; the defaults when None
    """
    settings = settings or Settings()
    mass = float(np.mean(made.truth.mass))
    weighed = weigh(made.drive, vehicle, "hybrid").result
    if weighed is None:
        raise RuntimeError(f"{load}, seed {made.scenario.seed}: nothing was weighed")
    balance = weighed.balance
    start = made.drive.start
    late_error = partial(_late_error, mass=mass, start=start)
    tracks: dict[str, MassTrack] = {}
    rmse, late_rmse, worst, held, seconds, steady_at = {}, {}, {}, {}, {}, {}
    for name, estimate in settings.estimators.items():
        begin = time.process_time()
        track = estimate(balance, vehicle)
        seconds[name] = time.process_time() - begin
        tracks[name] = track
        error = track.running_mass - mass
        late = late_error(track)
        std = track.running_std[track.time >= start + CONVERGED]
        held[name] = float(np.mean(np.abs(late) < 1.96 * std))
        rmse[name] = rms(error[np.isfinite(error)])
        late_rmse[name] = rms(late)
        worst[name] = float(np.max(np.abs(late))) / mass
        steady_at[name] = steady_from(track, mass, start)
    twice = replace(settings, count_grade_twice=True).estimators["robust-rls"](balance, vehicle)
    error = twice.running_mass - mass
    done = DriveResult(
        load=load,
        seed=made.scenario.seed,
        true_mass=mass,
        tracks=tracks,
        rmse=rmse,
        late_rmse=late_rmse,
        worst=worst,
        held=held,
        seconds=seconds,
        steady_at=steady_at,
        twice_rmse=rms(error[np.isfinite(error)]),
        blends={
            blend.value: rms(
                late_error(settings.blended(blend).estimators["hybrid"](balance, vehicle))
            )
            for blend in Blend
        },
    )
    if printed:
        _run_as_printed(done, balance, vehicle, made, settings)
    return done


def _late_error(track: MassTrack, mass: float, start: float) -> Floats:
    """Error of the running mass once it should have converged [kg]."""
    return np.asarray((track.running_mass - mass)[track.time >= start + CONVERGED])


def _run_as_printed(
    done: DriveResult,
    balance: ForceBalance,
    vehicle: Vehicle,
    made: SimulatedDrive,
    settings: Settings,
) -> None:
    """Run the methods as printed too, in each reading, and keep how far off they are."""
    mass, start = done.true_mass, made.drive.start
    late_error = partial(_late_error, mass=mass, start=start)

    def run(printed: HybridSettings) -> dict[str, MassTrack]:
        chosen = replace(settings, as_printed=True, printed=printed)
        return {m: estimate(balance, vehicle) for m, estimate in chosen.estimators.items()}

    for form in READINGS:
        code, found = form.code, run(form.of(settings.printed))
        late = {m: late_error(track) for m, track in found.items()}
        done.printed[code] = {m: rms(error) for m, error in late.items()}
        done.printed_mean[code] = {m: float(np.mean(error)) for m, error in late.items()}
        done.printed_worst[code] = {m: float(np.max(np.abs(e))) / mass for m, e in late.items()}
        done.printed_running[code] = {
            m: running_error(track, made, mass) for m, track in found.items()
        }
        if form in FORMS:
            done.printed_tracks[code] = found
        whole = form.of(settings.printed)
        unit = replace(
            whole,
            ekf=replace(whole.ekf, start_std=1.0 / mass, start_speed_std=1.0, start_grade_std=1.0),
        )
        done.unit_start[code] = rms(late_error(run(unit)["ekf"]))
    tenfold = FORMS[1].of(settings.printed)
    start_ = replace(tenfold.ekf.start, threshold=min(0.5, tenfold.ekf.start.threshold))
    found = run(replace(tenfold, ekf=replace(tenfold.ekf, start=start_)))
    done.opposite = _opposite(late_error(found[METHODS[0]]), late_error(found[METHODS[1]]))


def _opposite(least: Floats, kalman: Floats) -> Opposite:
    """Look at the errors (n,) of both filters, and at the best blend of a constant share [kg]."""
    apart = kalman - least
    share = float(np.clip(kalman @ apart / (apart @ apart), 0.0, 1.0))
    return Opposite(
        part=float(np.mean(least * kalman < 0.0)),
        share=share,
        parts=(rms(least), rms(kalman)),
        blended=rms(share * least + (1.0 - share) * kalman),
    )


def reproduce(
    *,
    seed: int = SEED,
    drives: int = DRIVES,
    progress: Progress | None = None,
    settings: Settings | None = None,
) -> Reproduction:
    """Weigh the bus as in the paper, and on the road.

    Parameters
    ----------
    seed : of the judged drives, counting on from it, the same at each load, as the paper's
        conditions are; those of the calibration are `CALIBRATION_SEED` further
    drives : judged at each load
    progress : called with steps done and steps in all
    settings : of our methods; the defaults when None
    """
    total = len(LOADS) * (CALIBRATION_DRIVES + 2 * drives) + 1
    done = 0

    def step() -> None:
        nonlocal done
        done += 1
        if progress:
            progress(done, total)

    known = []
    for k in range(CALIBRATION_DRIVES):
        for number, payload in enumerate(LOADS.values()):
            far = CALIBRATION_SEED + seed + len(LOADS) * k + number
            known.append(simulate(payload, far, as_paper=False))
            step()
    vehicle = run_calibration(
        [m.drive for m in known],
        [float(np.mean(m.truth.mass)) for m in known],
        vehicle=data_sheet(),
    ).vehicle
    vehicle = replace(vehicle, name="bus of Du 2025, calibrated")
    step()
    as_paper: list[DriveResult] = []
    road: list[DriveResult] = []
    sheet: list[DriveResult] = []
    payloads = (settings or Settings()).payloads
    for load, payload in zip(LOADS, payloads, strict=True):
        for k in range(drives):
            made = simulate(payload, seed + k, as_paper=True)
            if not as_paper:
                # The first call compiles, or loads what was compiled, and is not timed.
                judge(load, made, known_bus())
            as_paper.append(judge(load, made, known_bus(), printed=True, settings=settings))
            if k > 0:
                # Only the first drive of each load is drawn.
                as_paper[-1].printed_tracks.clear()
            step()
            made = simulate(payload, seed + k, as_paper=False)
            road.append(judge(load, made, vehicle, settings=settings))
            if k == 0:
                sheet.append(judge(load, made, data_sheet(), settings=settings))
            step()
    return Reproduction(
        drives=tuple(as_paper), road=tuple(road), sheet=tuple(sheet), vehicle=vehicle
    )


def reproduced(
    seed: int, progress: Progress | None, settings: Settings | None = None
) -> Reproduced:
    """Reproduce the paper and put it beside its own figures; see `reproduce`."""
    done = reproduce(seed=seed, progress=progress, settings=settings)

    values = figures(done)

    def write(tables: Sequence[Table], path: Path) -> None:
        from weighbridge.report.study import write_study

        write_study("Du et al. 2025, reproduced on simulated drives", tables, panels(done), path)

    seeds = sorted({d.seed for d in done.drives})
    seen = f"drives of seeds {seeds[0]} to {seeds[-1]}, calibrated {CALIBRATION_SEED} further"
    if not set(seeds) & TUNED:
        seen += ", none of which tuning saw"
    return Reproduced(
        title="Du et al. 2025",
        note=seen,
        tables=(
            printed_table(done),
            _cells(
                done.drives,
                "Table 2, our filters on the same drives, rolling of the tyres given",
            ),
            _cells(done.road, "Table 2 with all effects, the bus calibrated on other drives"),
            blend_table(done),
            _drives_table(done),
            _settings_table(done),
            _vehicle_table(done),
        ),
        rows=tuple(item.row("du2025", values) for item in ITEMS),
        write_page=write,
    )


def figures(done: Reproduction) -> dict[str, Found]:
    """Return the figures that the items of `ITEMS` ask for, by name."""
    found = equations()
    for load, theirs in PAPER_RMSE.items():
        for m, paper, time_ in zip(METHODS, theirs, PAPER_TIME[load], strict=True):
            found[f"{m} {load}"] = read(partial(_cell, done, load=load, method=m, paper=paper))
            seconds = float(cell(done.drives, load, m, "seconds").mean())
            found[f"time {m} {load}"] = Found(f"{seconds:.3f} s", seconds <= time_)
    for number, load in zip((5, 6, 7), LOADS, strict=True):
        found[f"fig {number}"] = read(partial(_worst, done, load=load))
    for name, judge in JUDGES.items():
        found[name] = read(partial(judge, done))
    found["work"] = Found(*work(done.drives))
    found |= our_rmse(done.drives, "ours") | our_rmse(done.road, "road")
    return found | _blended(done) | _given()


def our_rmse(drives: Sequence[DriveResult], name: str) -> dict[str, Found]:
    """RMSE of our methods beside Table 2, for the loads of some drives."""
    found = {}
    for load in dict.fromkeys(d.load for d in drives):
        for m, paper in zip(METHODS, PAPER_RMSE[load], strict=True):
            rmse = float(cell(tuple(drives), load, m, "late_rmse").mean())
            found[f"{m} {load} {name}"] = Found(f"{rmse:.0f} kg", rmse <= paper)
    return found


def read(judge: Callable[[str], tuple[str, bool]]) -> Found:
    """Judge a figure as printed; one that differs is looked for in the other `READINGS`.

    Parameters
    ----------
    judge : of the code of a `Form`: the figure, and whether it agrees with the printed one
    """
    text, agrees = judge(FORMS[0].code)
    if not agrees:
        for form in READINGS[1:]:
            other, holds = judge(form.code)
            if holds:
                why = f"{other} with {form.name}"
                return Found(text, agrees, why=why, check=form.check)
    return Found(text, agrees)


def _cell(
    done: Reproduction, form: str, *, load: str, method: str, paper: float
) -> tuple[str, bool]:
    """Compare one RMSE of Table 2."""
    rmse = float(cell(done.drives, load, method, "printed", form).mean())
    return f"{rmse:.0f} kg", abs(rmse / paper - 1.0) <= 0.1


def _worst(done: Reproduction, form: str, *, load: str) -> tuple[str, bool]:
    """Say how far the masses of figs. 5 to 7 are off at most."""
    most = [float(cell(done.drives, load, m, "printed_worst", form).max()) for m in METHODS]
    return f"{' / '.join(f'{100.0 * x:.1f}' for x in most)} % at most", max(most) < BAND


def _start(done: Reproduction, form: str) -> tuple[str, bool]:
    """Compare the Kalman filter of Table 2 with a first variance of 1 kg²."""
    each = [np.mean([d.unit_start[form] for d in done.drives if d.load == load]) for load in LOADS]
    paper = [PAPER_RMSE[load][1] for load in LOADS]
    said = " / ".join(f"{x:.0f}" for x in each)
    return f"{said} kg", all(x <= y for x, y in zip(each, paper, strict=True))


def _blended(done: Reproduction) -> dict[str, Found]:
    """Figures of blends, and of the start of the Kalman filter."""
    ratios = [
        np.mean([d.blends[Blend.INNOVATIONS.value] for d in drives if d.load == load])
        / min(float(cell(drives, load, m, "late_rmse").mean()) for m in METHODS[:2])
        for drives in (done.drives, done.road)
        for load in LOADS
    ]
    pairs = [d.opposite for d in done.drives if d.load == "half-load" and d.opposite is not None]
    least, kalman = np.mean([p.parts for p in pairs], axis=0)
    blended = float(np.mean([p.blended for p in pairs]))
    parts = [100.0 * p.part for p in pairs]
    shares = [p.share for p in pairs]
    return {
        "innovations": Found(
            f"{np.mean(ratios):.2f} in the mean, {max(ratios):.2f} at most",
            bool(np.mean(ratios) <= 1.03),
        ),
        "opposite": Found(
            f"{blended:.0f} of {least:.0f} and {kalman:.0f} kg; share {min(shares):.2f} to "
            f"{max(shares):.2f}, opposite signs in {min(parts):.0f} to {max(parts):.0f} % of the "
            "rows",
            bool(all(p.blended < min(p.parts) for p in pairs)),
        ),
        "unit start": read(partial(_start, done)),
    }


def _given() -> dict[str, Found]:
    """Figures of what the paper gives: h(v) at its ends, and Table 1."""
    both = PRINTED
    slow, fast = (share_at(v, both.blend_speed, both.blend_width) for v in (0.0, 40.0 / 3.6))
    sheet, start = data_sheet(), PRINTED.ekf.start
    line = sheet.driveline
    ours = [
        *(7000.0 + payload for payload in LOADS.values()),
        sheet.road.drag_area.value, line.wheel_radius, start.rolling_coefficient or 0.0,
        # The last gear but one is direct.
        line.gearings[4] * line.wheel_radius, wheel_efficiency(sheet), start.forgetting or 0.0,
    ]  # fmt: skip
    printed = [7000.0, 10_000.0, 13_000.0, 0.69 * 7.9, 0.49, 0.0005, 3.545, 0.95, 0.999]
    return {
        "fig 4": Found(f"{slow:.3f} at rest, {fast:.3f} at 40 km/h", slow > 0.99 and fast < 0.01),
        "table 1": same(np.array(printed), np.array(ours)),
    }


def printed_table(done: Reproduction) -> Table:
    """Table 2 by the paper's own settings: like for like, but for its simulator's tyres."""
    rows = []
    for load, theirs in PAPER_RMSE.items():
        for method, paper in zip(METHODS, theirs, strict=True):
            row = [f"{load}, {method}", f"{paper:.0f}"]
            for form in FORMS:
                mean = cell(done.drives, load, method, "printed", form.code).mean()
                lean = cell(done.drives, load, method, "printed_mean", form.code).mean()
                row.append(f"{mean:.0f} ({lean:+.0f})")
            rows.append(tuple(row))
    return Table(
        "Table 2 by the settings as printed (mean error in brackets), by rows and by the rolling "
        "resistance given to the filters: RMSE from 21 s on",
        ("load, method", "paper kg", *(f"{form.name} kg" for form in FORMS)),
        tuple(rows),
    )


def blend_table(done: Reproduction) -> Table:
    """RMSE of both filters and of each blend of them."""
    rows = []
    for name, drives in (("as in the paper", done.drives), ("all effects", done.road)):
        for load in LOADS:
            chosen = [d for d in drives if d.load == load]
            parts = [np.mean([d.late_rmse[m] for d in chosen]) for m in METHODS[:2]]
            blends = [np.mean([d.blends[blend.value] for d in chosen]) for blend in Blend]
            rows.append((f"{name}, {load}", *(f"{x:.0f}" for x in (*parts, *blends))))
    return Table(
        "Blends: RMSE from 21 s on [kg]",
        ("drives", *METHODS[:2], *(f"blend {blend.value}" for blend in Blend)),
        tuple(rows),
    )


def _cells(drives: tuple[DriveResult, ...], title: str) -> Table:
    rows = []
    for load, theirs in PAPER_RMSE.items():
        for method, paper, paper_time in zip(METHODS, theirs, PAPER_TIME[load], strict=True):
            every = cell(drives, load, method, "late_rmse")
            rows.append(
                (
                    f"{load}, {method}",
                    f"{paper:.0f}",
                    f"{every.mean():.0f}",
                    f"{every.max():.0f}",
                    f"{cell(drives, load, method, 'rmse').mean():.0f}",
                    f"{100.0 * cell(drives, load, method, 'worst').max():.1f}",
                    f"{paper_time:.1f}",
                    f"{cell(drives, load, method, 'seconds').mean():.3f}",
                )
            )
    return Table(
        f"{title}: RMSE from 21 s on, of {len(drives) // len(LOADS)} drives each",
        ("load, method", "paper kg", "mean kg", "worst kg", "from first mass kg", "largest error %",
         "paper s", "ours s"),
        tuple(rows),
    )  # fmt: skip


def _drives_table(done: Reproduction) -> Table:
    rows = []
    kinds = {"as in the paper": done.drives, "all effects": done.road, "data sheet": done.sheet}
    for kind, d in ((kind, d) for kind, drives in kinds.items() for d in drives):
        final = [d.tracks[m].mass for m in METHODS]
        best = min(METHODS, key=lambda m, d=d: d.late_rmse[m])  # type: ignore[misc]
        rows.append(
            (
                f"{kind}, {d.load}, seed {d.seed}",
                f"{d.true_mass:.0f}",
                *(f"{100.0 * (m / d.true_mass - 1.0):+.2f}" for m in final),
                *(f"{d.late_rmse[m]:.0f}" for m in METHODS),
                best,
            )
        )
    return Table(
        "Drives: final mass, running mass, and which method came out best",
        ("drive", "true kg", *(f"{m} %" for m in METHODS), *(f"RMSE {m}" for m in METHODS),
         "best"),
        tuple(rows),
    )  # fmt: skip


def _settings_table(done: Reproduction) -> Table:
    rows = []
    for load in LOADS:
        once = cell(done.road, load, "robust-rls", "rmse").mean()
        twice = np.mean([d.twice_rmse for d in done.road if d.load == load])
        rows.append(
            (
                f"{load}: RMSE of robust-rls, all effects, grade once | twice",
                f"{once:.0f} | {twice:.0f} kg",
            )
        )
    rows += setting_rows()
    return Table("Settings", ("setting", "value"), tuple(rows))


def _vehicle_table(done: Reproduction) -> Table:
    sheet, car = data_sheet(), done.vehicle
    offset, scale, *_ = car.torque.coefficients
    return Table(
        "Vehicle",
        ("parameter", "data sheet", "calibrated"),
        (
            ("torque offset N m", "0", f"{offset:.1f}"),
            ("torque scale, efficiency in it", f"{wheel_efficiency(sheet):.3f}", f"{scale:.3f}"),
            ("engine inertia kg m²", f"{sheet.road.engine_inertia.value:.2f}",
             f"{car.road.engine_inertia.value:.2f}"),
            ("drag area m²", f"{sheet.road.drag_area.value:.2f}",
             f"{car.road.drag_area.value:.2f}"),
            ("rolling coefficient", f"{sheet.road.rolling_coefficient.value:.4f}",
             f"{car.road.rolling_coefficient.value:.4f}"),
        ),
    )  # fmt: skip
