"""How long each file of tests takes: long files start first, and `.ci/quick` takes what fits.

``pytest --junitxml=build/tests.xml`` and then ``python -m tests.order build/tests.xml`` write
the list again.
"""

import csv
import sys
from collections import Counter
from pathlib import Path
from xml.etree import ElementTree

ROOT = Path(__file__).resolve().parents[1]
LIST = ROOT / "tests" / "order.csv"
UNKNOWN = 10.0
"""Taken for a file that is not on the list [s]."""


def seconds() -> dict[str, float]:
    """Return the seconds of each file on the list, by its path in the checkout."""
    with LIST.open(encoding="utf-8", newline="") as file:
        return {row["file"]: float(row["seconds"]) for row in csv.DictReader(file)}


def longest_first(items: list) -> None:
    """Put the tests of long files first; within a file the order stays."""
    known = seconds()
    items.sort(key=lambda item: -known.get(item.path.relative_to(ROOT).as_posix(), UNKNOWN))


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
