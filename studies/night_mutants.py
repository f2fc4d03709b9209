"""Plant one fault of one line in live at a time, and see whether short nights notice.

Run from the checkout: ``python studies/night_mutants.py``, which writes
``studies/night_mutants.csv``; names of mutants as arguments run those alone. A copy of the source
is changed, never the checkout. Found is a mutant in whose nights something is wrong by the same
rules that judge a night; that the digest is another one counts for nothing.
"""

from __future__ import annotations

import csv
import os
import pickle
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from pathlib import Path
from typing import NamedTuple

HERE = Path(__file__).resolve().parent
SOURCE = HERE.parent / "src"
TABLE = HERE / "night_mutants.csv"
SEEDS = (502, 503, 506, 507, 509)
"""Nights that are tried in turn until something is wrong; none of them judges a whole night."""

HOURS, APART = 0.6, 60.0
"""Driving of each [h], and between two pairs of faults [s]."""

PATIENCE = 400.0
"""A mutant with which a night takes longer is ended and counts as found: it hangs [s]."""


class Mutant(NamedTuple):
    """A line of a module, what it becomes, and what that breaks."""

    name: str
    path: str
    line: str
    planted: str


def mutants() -> list[Mutant]:
    """Read the list of faults to plant."""
    text = (HERE / "night_mutants.toml").read_text(encoding="utf-8")
    return [Mutant(**row) for row in tomllib.loads(text)["mutant"]]


def planted(mutant: Mutant, folder: Path) -> None:
    """Copy the source with a mutant in it."""
    shutil.copytree(SOURCE, folder, ignore=shutil.ignore_patterns("__pycache__"))
    path = folder / "weighbridge" / mutant.path
    whole = path.read_text(encoding="utf-8")
    if whole.count(mutant.line) != 1:
        raise SystemExit(f"{mutant.name}: its line is not there once; correct the list")
    path.write_text(whole.replace(mutant.line, mutant.planted), encoding="utf-8")


def found(mutant: Mutant, prepared: Path, home: Path) -> tuple[str, float]:
    """Let nights pass with a mutant; return what was wrong, empty for nothing, and the time [s]."""
    folder = home / "src"
    planted(mutant, folder)
    begin, wrong = time.perf_counter(), ""
    environment = {
        **os.environ, "PYTHONPATH": f"{folder}:{HERE}", "WEIGHBRIDGE_NIGHT": str(prepared),
    }  # fmt: skip
    for seed in SEEDS:
        words = (sys.executable, str(HERE / "night_mutants.py"), "--night", str(seed))
        try:
            ran = subprocess.run(
                words, capture_output=True, text=True, check=False, env=environment,
                timeout=PATIENCE,
            )  # fmt: skip
            wrong = ran.stdout.strip().splitlines()[-1] if ran.returncode else ""
            if ran.returncode and not wrong:
                wrong = f"crash: {ran.stderr.strip().splitlines()[-1]}"
        except subprocess.TimeoutExpired:
            wrong = "hangs"
        if wrong:
            wrong = f"night {seed}: {wrong}"
            break
    shutil.rmtree(folder)
    return wrong, time.perf_counter() - begin


def one_night(seed: int) -> int:
    """Let one short night pass in this process; end with 1 where something is wrong."""
    import night

    with Path(os.environ["WEIGHBRIDGE_NIGHT"]).open("rb") as file:
        car, bases = pickle.load(file)
    try:
        result = night.night(seed, HOURS, apart=APART, hasty=True, car=car, bases=bases)
    except night.WrongError as wrong:
        print(str(wrong).splitlines()[0])
        return 1
    for what, texts in result.judged.wrong.items():
        print(f"{what}: {texts[0]}")
    return int(not result.holds)


def main() -> int:
    """Write the table; end with 1 where the program as it is has something wrong."""
    if sys.argv[1:2] == ["--night"]:
        return one_night(int(sys.argv[2]))
    listed = mutants()
    chosen = [m for m in listed if not sys.argv[1:] or m.name in sys.argv[1:]]
    import night

    with tempfile.TemporaryDirectory() as folder:
        home = Path(folder)
        prepared = home / "night.pickle"
        with prepared.open("wb") as file:
            pickle.dump((night.vehicle(), night.drives()), file)
        rows = []
        none = Mutant("none", listed[0].path, listed[0].line, listed[0].line)
        for mutant in (none, *chosen):
            wrong, spent = found(mutant, prepared, home)
            print(f"{spent:6.0f} s  {mutant.name}: {wrong or '-'}", flush=True)
            if mutant is none and wrong:
                return 1
            rows.append((mutant.name, mutant.path, wrong))
    if len(chosen) == len(listed):
        with TABLE.open("w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerows([("mutant", "module", "found by"), *rows[1:]])
    return 0


if __name__ == "__main__":
    sys.exit(main())
