"""Figures of studies/jensen2022_band.md: what keeps the running mass of `rls` out of ±5 %.

Run from the checkout: ``python studies/jensen2022_band.py ROWS``, some two hours of one processor.
ROWS is a folder for the results of single drives; what lies there already is not run again, and
``--rows-only`` writes the page from it. ``--drives 1 7`` and ``--calibrations 3`` run a part and
print its tables; the page stays. Drives are of seeds 172000 to 172018 for the causes and
172100 to 172119 for the torque map; nothing was chosen on either.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from weighbridge.calibration.run import run_calibration
from weighbridge.calibration.settings import CalibrationSettings
from weighbridge.estimators import RlsSettings
from weighbridge.estimators.rls import estimate
from weighbridge.estimators.track import MassTrack
from weighbridge.navigation.printed import PrintedFilterSettings
from weighbridge.papers.jensen2022_drives import (
    TABLE_B1,
    Conditions,
    TestDrive,
    scenario,
    without_weather,
)
from weighbridge.papers.jensen2022_judged import BAND, DriveResult, judge, judge_track
from weighbridge.papers.jensen2022_reproduction import (
    PrintedSettings,
    Reproduction,
    reproduce,
    train,
    weigh_as_printed,
)
from weighbridge.pipeline.weighing import weigh
from weighbridge.simulation import make_scenario, simulate_car

HERE = Path(__file__).parent
MAPS, CAUSES = 172_100, 172_000
CALIBRATIONS = 20
CAUSE_DRIVES = (1, 7, 9, 11, 14, 18)
"""Drives under other conditions too: the first of each day, most load, wind and windows."""

FILTER_DRIVES = (1, 2, 3, 4)
"""Drives by the paper's filter with other rules as well."""

CONDITIONS = {
    "nowind": ("no wind", Conditions(wind=0.0)),
    "warm": ("no cold start", Conditions(cold=0.0)),
    "both": ("neither", Conditions(wind=0.0, cold=0.0)),
}
PRINTED = {
    "printed": PrintedSettings(),
    "plumb": PrintedSettings(filter=PrintedFilterSettings(plumb_line=True)),
    "chord20": PrintedSettings(filter=PrintedFilterSettings(chord_fixes=20)),
}
TOLD = {"base": "as they are", "filter": "as they are", **{k: c[0] for k, c in CONDITIONS.items()}}
METHODS = {
    "ours": "ours",
    "ours, paper rows": "our motion and fit, the paper's least squares and rows",
    "printed": "the paper's own rules",
    "printed, our rows": "the paper's motion and fit, our rows and gate",
    "plumb": "the paper's rules, down along the plumb line",
    "chord20": "the paper's rules, first yaw from a chord of 20 fixes in place of 2",
}

Row = dict[str, float | int | str | bool]


def judged(result: DriveResult) -> Row:
    return {
        "worst": result.worst,
        "at": result.worst_at,
        "typical": result.typical,
        "inside": result.inside,
        "error": result.error,
        "covered": bool(result.covered),
    }


def trained(seed: int):
    """Return the calibration drive of a seed as nobody with a weather report sees it, its mass."""
    known = simulate_car(make_scenario("car-calibration", seed=seed))
    return without_weather(known.drive), float(np.mean(known.truth.mass))


def maps(done: Sequence[Row], count: int) -> Iterator[Row]:
    """Weigh two drives by each calibration, with a curved and with a straight map."""
    there = {(r["cal"], r["seed"], r["curved"]) for r in done}
    for k in range(count):
        if sum(cal == MAPS + k for cal, _, _ in there) == 4:
            continue
        drive, mass = trained(MAPS + k)
        cars = {
            curved: run_calibration(
                drive, mass, settings=CalibrationSettings(method="rls", curved=curved)
            )
            for curved in (True, False)
        }
        for row, seed in ((k % 18, k + 7), (k + 9, k + 13)):
            table_row, seed = TABLE_B1[row % 18], MAPS + seed % CALIBRATIONS
            made = simulate_car(scenario(table_row, seed=seed))
            for curved, car in cars.items():
                if (MAPS + k, seed, curved) in there:
                    continue
                w = weigh(without_weather(made.drive), car.vehicle, method="rls")
                yield {
                    "cal": MAPS + k,
                    "seed": seed,
                    "row": table_row.number,
                    "curved": curved,
                    "r2": car.rows.r_squared,
                    **judged(judge(table_row, made, w)),
                }


def causes(done: Sequence[Row], drives: Sequence[int]) -> Iterator[Row]:
    """Weigh the drives of the table with and without wind and cold, by several rules."""
    drive, mass = trained(CAUSES)
    straight = CalibrationSettings(method="rls", curved=False)
    ours = run_calibration(drive, mass, settings=straight).vehicle
    cars = {name: train(drive, mass, s) for name, s in PRINTED.items()}
    there = {(r["variant"], r["row"]) for r in done}
    for row in (row for row in TABLE_B1 if row.number in drives):
        for variant, (_, conditions) in CONDITIONS.items():
            if (variant, row.number) in there or row.number not in CAUSE_DRIVES:
                continue
            found: dict[str, DriveResult] = {}
            made = simulate_car(scenario(row, seed=CAUSES + row.number, conditions=conditions))
            seen = without_weather(made.drive)
            weighing = weigh(seen, ours, method="rls")
            found["ours"] = judge(row, made, weighing)
            track = estimate(weighing.result.balance, ours, PrintedSettings().rls)
            found["ours, paper rows"] = judge_track(row, made, track)
            track = weigh_as_printed(seen, cars["printed"], PRINTED["printed"])
            found["printed"] = judge_track(row, made, track)
            own = estimate(track.balance, cars["printed"].vehicle, RlsSettings())
            found["printed, our rows"] = judge_track(row, made, own)
            yield from rows_of(variant, row, found)
        if row.number in FILTER_DRIVES and ("filter", row.number) not in there:
            made = simulate_car(scenario(row, seed=CAUSES + row.number))
            seen = without_weather(made.drive)
            yield from rows_of("filter", row, {
                name: judge_track(row, made, weigh_as_printed(seen, cars[name], PRINTED[name]))
                for name in PRINTED if name != "printed"
            })  # fmt: skip


def as_they_are(done: Reproduction) -> Iterator[Row]:
    """Take the drives as they are from a reproduction of the paper: same seeds, same rules."""
    for ours, printed in zip(done.drives, done.printed, strict=True):
        row = ours.drive
        other = estimate(ours.balance, done.car, PrintedSettings().rls)
        own = estimate(printed.balance, done.printed_car.vehicle, RlsSettings())
        yield from rows_of("base", row, {
            "ours": ours,
            "ours, paper rows": rejudged(ours, other),
            "printed": printed,
            "printed, our rows": rejudged(printed, own),
        })  # fmt: skip


def rejudged(result: DriveResult, track: MassTrack) -> DriveResult:
    """Judge another running mass of the same balance."""
    part = (track.time - track.time[0]) / (track.time[-1] - track.time[0])
    last = part >= 1.0 / 3.0
    off = track.running_mass[last] / result.true_mass - 1.0
    return replace(
        result,
        track=track,
        worst=float(np.max(np.abs(off))),
        worst_at=float(part[last][np.argmax(np.abs(off))]),
        typical=float(np.mean(off)),
        inside=float(np.mean(np.abs(off) <= BAND)),
        error=float(track.running_mass[-1] / result.true_mass - 1.0),
        covered=False,
    )


def rows_of(variant: str, row: TestDrive, found: dict[str, DriveResult]) -> Iterator[Row]:
    for method, result in found.items():
        yield {"variant": variant, "row": row.number, "method": method, **judged(result)}


def kept(path: Path) -> list[Row]:
    if not path.exists():
        return []
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]


def run(path: Path, rows: Iterator[Row]) -> None:
    with path.open("a", encoding="utf-8") as out:
        for row in rows:
            out.write(json.dumps(row) + "\n")
            out.flush()


def column(rows: Sequence[Row], name: str) -> np.ndarray:
    return 100.0 * np.array([float(r[name]) for r in rows])


def summary(rows: Sequence[Row]) -> str:
    worst, typical = column(rows, "worst"), column(rows, "typical")
    at = np.median(column(rows, "at"))
    return (
        f"| {np.count_nonzero(worst <= 100.0 * BAND)} of {len(rows)} | {worst.mean():.2f} "
        f"| {at:.0f} | {column(rows, 'inside').mean():.1f} | {typical.mean():+.2f} "
        f"| {np.sqrt(np.mean(typical**2)):.2f} |"
    )


HEADS = (
    "| within ±5 % throughout | worst %, mean | at % of the drive | time inside % | mean % "
    "| RMS of means % |"
)


def causes_table(rows: Sequence[Row]) -> str:
    """One row for each rule and condition: all drives as they are, then those changed."""
    blocks = (
        ("All drives of Table B.1.", range(1, 19), ("base",)),
        (f"Drives {told(CAUSE_DRIVES)}.", CAUSE_DRIVES, ("base", *CONDITIONS)),
        (f"Drives {told(FILTER_DRIVES)}: the paper's filter.", FILTER_DRIVES, ("base", "filter")),
    )
    texts = []
    for k, (title, numbers, variants) in enumerate(blocks):
        lines = [title, "", f"| rules | drives {HEADS}", "|" + "---|" * 8]
        methods = PRINTED if k == 2 else [m for m in METHODS if m not in ("plumb", "chord20")]
        for method in methods:
            for variant in variants:
                kind = (method, variant)
                chosen = [
                    r for r in rows if (r["method"], r["variant"]) == kind and r["row"] in numbers
                ]
                if chosen:
                    lines.append(f"| {METHODS[method]} | {TOLD[variant]} {summary(chosen)}")
        texts.append("\n".join(lines))
    return "\n\n".join(texts)


def told(numbers: Sequence[int]) -> str:
    return ", ".join(str(n) for n in numbers)


def maps_table(rows: Sequence[Row]) -> str:
    lines = [
        f"| torque map {HEADS[:-1]} | final mass, RMS % | mean % | held | R² of the fit |",
        "|" + "---|" * 11,
    ]
    for curved, words in ((True, "curved"), (False, "straight, as eq. 49 prints")):
        chosen = [r for r in rows if r["curved"] is curved]
        error = column(chosen, "error")
        lines.append(
            f"| {words} {summary(chosen)} {np.sqrt(np.mean(error**2)):.2f} | {error.mean():+.2f} "
            f"| {sum(bool(r['covered']) for r in chosen)} of {len(chosen)} "
            f"| {np.mean(column(chosen, 'r2')) / 100.0:.4f} |"
        )
    return "\n".join(lines) + "\n\n" + differences(rows)


def of_map(rows: Sequence[Row], calibration: int, curved: bool) -> list[Row]:
    return [r for r in rows if r["cal"] == calibration and r["curved"] is curved]


def differences(rows: Sequence[Row]) -> str:
    """Mean difference of the two maps over calibrations, with its standard error."""
    said = []
    for name, words in (
        ("error", "error of the final mass"),
        ("typical", "mean error of the running mass"),
        ("worst", "largest error of the running mass"),
    ):
        by = []
        for cal in sorted({r["cal"] for r in rows}):
            curved, straight = (
                np.mean(
                    np.abs(column([r for r in rows if r["cal"] == cal and r["curved"] is c], name))
                )
                for c in (True, False)
            )
            by.append(curved - straight)
        gap = np.array(by)
        std = gap.std(ddof=1) / np.sqrt(gap.size)
        said.append(
            f"{words} {gap.mean():+.2f} ± {std:.2f} % (curved is better in "
            f"{np.count_nonzero(gap < 0)} of {gap.size} calibrations)"
        )
    return "Curved less straight, absolute errors, one standard error:\n\n" + "\n".join(
        f"- {each}" for each in said
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("rows", type=Path)
    parser.add_argument("--rows-only", action="store_true")
    parser.add_argument("--drives", type=int, nargs="*", help="of Table B.1, for the causes")
    parser.add_argument("--calibrations", type=int, help="how many, for the torque maps")
    asked = parser.parse_args()
    asked.rows.mkdir(exist_ok=True)
    of_maps, of_causes = asked.rows / "maps.jsonl", asked.rows / "causes.jsonl"
    part = asked.drives is not None or asked.calibrations is not None
    drives = tuple(asked.drives or ()) if part else tuple(row.number for row in TABLE_B1)
    count = (asked.calibrations or 0) if part else CALIBRATIONS
    if not asked.rows_only:
        if count:
            run(of_maps, maps(kept(of_maps), count))
        if not part and not any(r["variant"] == "base" for r in kept(of_causes)):
            run(of_causes, as_they_are(reproduce(trips=())))
        if drives:
            run(of_causes, causes(kept(of_causes), drives))
    tables = {}
    if rows := kept(of_causes):
        tables["causes"] = causes_table(rows)
    if rows := kept(of_maps):
        tables["maps"] = maps_table(rows)
    if part:
        print(*tables.values(), sep="\n\n")
        return
    page = (HERE / "jensen2022_band.template.md").read_text(encoding="utf-8")
    for name, table in tables.items():
        page = page.replace(f"<!-- {name} -->", table)
    (HERE / "jensen2022_band.md").write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
