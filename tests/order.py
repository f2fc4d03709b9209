"""Which tests run first, and which only when asked for.

Files that start other programs come first, then long ones; those whose processes take much memory
are run one at a time. `.ci/quick` takes what fits. Tests of `long.toml` run with ``--long``.

``pytest --junitxml=build/tests.xml`` and then ``python -m tests.order build/tests.xml`` write
the list again.
"""

import csv
import math
import sys
import tomllib
from collections import Counter
from pathlib import Path
from xml.etree import ElementTree

ROOT = Path(__file__).resolve().parents[1]
LIST = ROOT / "tests" / "order.csv"
LONG = ROOT / "tests" / "long.toml"
STARTING = (
    "cli/test_fleet_command.py",
    "fleet/test_kills.py",
    "fleet/test_learning.py",
    "fleet/test_run.py",
    "unit/test_damaged_logs.py",
    "unit/test_fault_study.py",
    "unit/test_simulated_fleet.py",
)
"""Files whose tests start processes that weigh; each takes up to 400 MB."""

UNKNOWN = 10.0
"""Taken for a file that is not on the list [s]."""


def seconds() -> dict[str, float]:
    """Return the seconds of each file on the list, by its path in the checkout."""
    with LIST.open(encoding="utf-8", newline="") as file:
        return {row["file"]: float(row["seconds"]) for row in csv.DictReader(file)}


def starts_processes(item) -> bool:
    """Whether a test is of a file of `STARTING`."""
    return item.path.as_posix().endswith(STARTING)


def longest_first(items: list) -> None:
    """Put the tests of new and of long files first; within a file the order stays.

    Before them come files that start other programs, while the workers themselves are small: first
    those that need the browser, which is the largest.
    """
    known = seconds()
    took = {i.path: known.get(i.path.relative_to(ROOT).as_posix(), math.inf) for i in items}
    browsing = {item.path for item in items if "chromium" in item.fixturenames}
    large = browsing | {item.path for item in items if starts_processes(item)}
    starting = large | {item.path for item in items if hasattr(item.module, "subprocess")}
    files = sorted(took, key=lambda path: (path not in starting, path not in browsing, -took[path]))
    place = {path: k for k, path in enumerate(one_at_a_time(files, large, took))}
    items.sort(key=lambda item: place[item.path])


def one_at_a_time(files: list, large: set, took: dict) -> list:
    """Put files apart that wait for each other, where two workers take one after another.

    Parameters
    ----------
    files : in the order that is kept otherwise
    large : those of them that wait for each other
    took : of each [s]
    """
    waiting = [file for file in files if file in large]
    others = [file for file in files if file not in large]
    ordered: list = []
    free, closed = [0.0, 0.0], 0.0
    while waiting or others:
        begin = min(free)
        turn = waiting if waiting and (closed <= begin or not others) else others
        ordered.append(turn.pop(0))
        last = took[ordered[-1]]
        end = begin + (last if math.isfinite(last) else UNKNOWN)
        free[free.index(begin)] = end
        if turn is waiting:
            closed = end
    return ordered


def guards() -> dict[str, str]:
    """Return the long tests, each with the quicker one that notices the same faults."""
    return {
        test: entry["guard"]
        for entry in tomllib.loads(LONG.read_text(encoding="utf-8"))["long"]
        for test in entry["tests"]
    }


def is_long(name: str, listed: dict[str, str]) -> bool:
    """Tell whether a test is on the list, by itself or with all its parameters."""
    return name in listed or name.partition("[")[0] in listed


def write(results: Path) -> None:
    """Write the list from a junit file of a run of all tests."""
    taken: Counter[str] = Counter()
    for case in ElementTree.parse(results).iter("testcase"):
        parts = case.attrib["classname"].split(".")
        # A class of tests is the last part of some names.
        while parts and not (path := ROOT.joinpath(*parts).with_suffix(".py")).is_file():
            parts.pop()
        if parts:
            taken[path.relative_to(ROOT).as_posix()] += float(case.attrib["time"])
    with LIST.open("w", encoding="utf-8", newline="") as file:
        rows = csv.writer(file, lineterminator="\n")
        rows.writerow(["file", "seconds"])
        rows.writerows([name, f"{taken[name]:.1f}"] for name in sorted(taken))


if __name__ == "__main__":
    write(Path(sys.argv[1]))
