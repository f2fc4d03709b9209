"""``weighbridge benchmark``: drives of unknown mass, and the score of any program's masses."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from weighbridge.cli.listed import ListsNames, argument, method_names, option, slice_names
from weighbridge.cli.progress import progress
from weighbridge.cli.results import Inputs, Result, asked_for, refuse_results, write_json
from weighbridge.cli.terminal import console, say, shown
from weighbridge.cli.verbosity import say_written

if TYPE_CHECKING:
    import polars as pl
    from rich.table import Table

app = typer.Typer(
    no_args_is_help=True,
    help="Make drives of unknown mass, weigh them, and score the masses of any program.",
)

_WIDTH: Final = 100
"""Of the score: no column is cut off."""

_HEADS: Final = {
    "drives": ("drives", "d"),
    "refused_pct": ("refused %", ".0f"),
    "rms_pct": ("RMS %", ".2f"),
    "mean_pct": ("mean %", "+.2f"),
    "held_pct": ("95 % hold", ".0f"),
    "interval_score_pct": ("score %", ".2f"),
    "squared_error_over_variance": ("error²/var", ".2f"),
    "falsely_sure": ("falsely sure", "d"),
}
"""Head and format of each column of the score."""


@app.command()
def make(
    output: Annotated[Path, option("benchmark make --output")],
    seed: Annotated[int, option("--seed", min=0)] = 1,
    vehicles: Annotated[int, option("benchmark make --vehicles")] = 1,
    drives: Annotated[int, option("benchmark make --drives")] = 4,
    minutes: Annotated[float, option("--minutes")] = 20.0,
    only: Annotated[
        list[str] | None, option("benchmark make --only", autocompletion=slice_names)
    ] = None,
) -> None:
    """Simulate drives of unknown mass, as folders of Parquet tables, with the truth apart.

    The whole benchmark is 240 drives to weigh and 80 of known mass, 330 MB, made in some 2 minutes.
    Made again into the same folder, it goes on where it was interrupted.

    Example: weighbridge benchmark make -o bench/ --only truck --drives 2
    """
    from weighbridge.benchmark.make import make_benchmark
    from weighbridge.benchmark.plan import BenchmarkSettings

    settings = BenchmarkSettings(
        seed=seed, vehicles=vehicles, drives=drives, minutes=minutes, only=tuple(only or ())
    )
    with progress("simulating the drives") as bar:
        count = make_benchmark(output, settings, tell=bar.tell)
    say(f"{output}: {count} drives to weigh; README.md says how. Weigh them with")
    say(f"  weighbridge benchmark run {output} -o RESULTS.csv")


@app.command(cls=ListsNames)
def run(
    folder: Annotated[Path, argument("benchmark run FOLDER")],
    output: Annotated[Path, option("benchmark run --output")],
    method: Annotated[str, option("--method", autocompletion=method_names)] = "joint",
) -> None:
    """Calibrate the vehicles of a benchmark and weigh their drives with one method.

    Example: weighbridge benchmark run bench/ --method rls -o rls.csv
    """
    import polars as pl

    from weighbridge.benchmark.make import DRIVES, TRUTH
    from weighbridge.benchmark.run import RESULT_COLUMNS, read_drives, run_benchmark
    from weighbridge.errors import ConfigError
    from weighbridge.io.write import write_frame

    read = Inputs(files=(folder / DRIVES, folder / TRUTH))
    refuse_results(read, [Result("--output", output, "table of masses")])
    rows = []
    with progress("weighing", read_drives(folder).height) as bar:
        for row in run_benchmark(folder, [method]):
            rows.append(row)
            bar.tell(len(rows), bar.total)
    found = pl.DataFrame(rows, {**RESULT_COLUMNS, "method": pl.String()}).drop("method")
    write_frame(found, output, ConfigError)
    say_written(output)


@app.command()
def score(
    results: Annotated[list[Path], argument("benchmark score RESULTS")],
    truth: Annotated[Path | None, option("benchmark score --truth")] = None,
    json_path: Annotated[str | None, option("benchmark score --json")] = None,
) -> None:
    """Score the masses of any program, slice by slice.

    Example: weighbridge benchmark score mine.csv --truth bench/truth.csv
    """
    import json

    from weighbridge.benchmark.score import read_results, read_truth, score_masses

    place = truth if truth is not None else results[0].parent / "truth.csv"
    refuse_results(Inputs(files=(*results, place)), asked_for(json=json_path))
    true = read_truth(place)
    found = {path: score_masses(read_results(path, true), true) for path in results}
    scores = [{"results": str(path), "slices": one.to_dicts()} for path, one in found.items()]
    if not write_json(json_path, json.dumps(scores)):
        screen = console()
        screen.width = max(_WIDTH, screen.width)
        screen.print(_table(found))
        if json_path is not None:
            say_written(json_path)


def _table(found: dict[Path, pl.DataFrame]) -> Table:
    """Show one file slice by slice, or several over all drives."""
    from rich.table import Table

    alone = len(found) == 1
    table = Table(box=None, pad_edge=False)
    table.add_column("" if alone else "results")
    for head, _ in _HEADS.values():
        table.add_column(head, justify="right")
    for path, score in found.items():
        for row in score.to_dicts() if alone else score.head(1).to_dicts():
            cells = [
                "–" if row[name] is None else format(row[name], form)
                for name, (_, form) in _HEADS.items()
            ]
            table.add_row(row["slice"] if alone else shown(path.stem), *cells)
    return table
