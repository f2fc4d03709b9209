"""Weigh the open benchmark with every method, and write the tables of ``docs/benchmark.md``.

Run from the checkout, on a seed that nothing was tuned on::

    weighbridge benchmark make -o bench/ --seed 20261128
    python studies/benchmark.py bench/

Results of a method that are there are kept, so that a run can be interrupted. Only the tables
between the marks of the page are written.
"""

from __future__ import annotations

import argparse
import datetime
import tomllib
from pathlib import Path

import polars as pl

from weighbridge.benchmark.make import SETTINGS, TRUTH
from weighbridge.benchmark.run import RESULT_COLUMNS, run_benchmark
from weighbridge.benchmark.score import read_results, read_truth, score_masses
from weighbridge.estimators import ESTIMATORS
from weighbridge.whole import write_whole

PAGE = Path(__file__).parents[1] / "docs" / "benchmark.md"
BEGIN, END = "<!-- written by studies/benchmark.py -->\n", "<!-- end -->\n"
HEADS = (
    "drives",
    "refused %",
    "RMS %",
    "mean %",
    "95 % hold",
    "score %",
    "error²/var",
    "falsely sure",
)
FORMS = ("d", ".0f", ".1f", "+.1f", ".0f", ".0f", ".2f", "d")


def methods() -> list[str]:
    """Every method that weighs by torque."""
    return [name for name in ESTIMATORS.own if not ESTIMATORS[name].speed_alone]


def weigh(folder: Path, wanted: list[str]) -> None:
    """Write the results of the methods that have none yet."""
    wanted = [name for name in wanted if not (folder / f"{name}.csv").exists()]
    if not wanted:
        return
    rows = pl.DataFrame(
        list(run_benchmark(folder, wanted)), {"method": pl.String(), **RESULT_COLUMNS}
    )
    for name in wanted:
        rows.filter(method=name).drop("method").write_csv(folder / f"{name}.csv")


def table(first: str, named: list[tuple[str, dict]]) -> str:
    """Lay out rows of scores."""
    lines = [f"|{first}|{'|'.join(HEADS)}|", "|---" + "|---:" * len(HEADS) + "|"]
    for name, row in named:
        values = [v for k, v in row.items() if k not in ("by", "slice")]
        cells = ["–" if v is None else format(v, f) for v, f in zip(values, FORMS, strict=True)]
        lines.append(f"|{name}|{'|'.join(cells)}|")
    return "\n".join(lines) + "\n"


def errors(scores: dict[str, list[dict]]) -> str:
    """Lay out the RMS of every method in every slice but those of routes."""
    names = [row["slice"] for row in scores["joint"] if row["by"] not in ("all", "route")]
    lines = [f"|RMS %|{'|'.join(names)}|", "|---" + "|---:" * len(names) + "|"]
    for method, rows in scores.items():
        found = {row["slice"]: row["rms_pct"] for row in rows}
        cells = ["–" if found[name] is None else f"{found[name]:.1f}" for name in names]
        lines.append(f"|`{method}`|{'|'.join(cells)}|")
    return "\n".join(lines) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--method", action="append", help="weigh with these alone, write no page")
    asked = parser.parse_args()
    weigh(asked.folder, asked.method or methods())
    if asked.method:
        return
    truth = read_truth(asked.folder / TRUTH)
    scores = {
        name: score_masses(read_results(asked.folder / f"{name}.csv", truth), truth).to_dicts()
        for name in methods()
    }
    made = tomllib.loads((asked.folder / SETTINGS).read_text(encoding="utf-8"))
    today = datetime.date.today()
    said = (
        f"Measured on {today.day} {today:%B %Y} with weighbridge {made['weighbridge']}, seed "
        f"{made['seed']}, {truth.height} drives.\n"
    )
    every = table("method", [(f"`{name}`", rows[0]) for name, rows in scores.items()])
    by_slice = errors(scores)
    joint = scores["joint"]
    held = [row["held_pct"] for row in joint[1:]]
    routes = [row["rms_pct"] for row in joint if row["by"] == "route"]
    slices = (
        f"By slice, {min(held):.0f} to {max(held):.0f} % of the intervals of `joint` hold. By "
        f"route its RMS is {min(routes):.1f} to {max(routes):.1f} %.\n"
    )
    before, _, rest = PAGE.read_text(encoding="utf-8").partition(BEGIN)
    after = rest.partition(END)[2]
    write_whole(PAGE, f"{before}{BEGIN}\n{said}\n{every}\n{by_slice}\n{slices}\n{END}{after}")


if __name__ == "__main__":
    main()
