"""Write docs/papers.md: every row of the four papers, and their methods on other vehicles.

Run from the checkout: ``python studies/papers.py`` for the rows, ``--vehicles`` for the table of
other vehicles, which takes longer. With ``--check`` the rows are made anew and compared with the
page, and nothing is written: exit status 1 where one differs.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from other_simulators import CLASSES, DRIVER, masses
from second_model import make_drive, random_vehicle

import weighbridge as wb
from weighbridge import papers
from weighbridge.errors import WeighbridgeError
from weighbridge.papers.claims import document

PAGE = Path(__file__).parents[1] / "docs" / "papers.md"
HEAD = "## Vehicles that nobody tuned on"
SEED = 7200
KINDS = ("small_petrol", "petrol", "petrol_dct", "petrol_automatic", "diesel", "van")
KNOWN = ((0.0, "ordinary"), (0.45, "ordinary"), (0.9, "ordinary"))
WEIGHED = (
    (0.0, "ordinary"), (0.95, "ordinary"), (0.6, "motorway"), (0.3, "city"), (0.8, "calm"),
)  # fmt: skip
METHODS = {
    "joint": "joint (ours)",
    "robust-rls": "robust-rls (Du)",
    "rls": "rls (Jensen)",
    "hybrid": "hybrid (Du)",
    "ekf": "ekf (Du)",
    "speed-torque-ekf": "speed-torque-ekf (Galvão)",
}
TIME = ("computing time",)
"""Rows that no two runs have alike."""


def rows() -> str:
    """Reproduce all papers: the page of their rows."""
    return document(papers.paper(n)(papers.seed_of(n), None).section for n in papers.PAPERS)


def weighed(root: Path, kind: str, seed: int) -> Iterator[tuple[str, float, float, bool]]:
    """Calibrate a vehicle on three drives and weigh five others: method, error, std, weighed."""
    made = random_vehicle(kind, seed=seed)
    folders = []
    for k, (share, style) in enumerate((*KNOWN, *WEIGHED)):
        mass = made.tare + DRIVER + share * (made.gross - made.tare - DRIVER)
        folder = root / f"drive-{k}"
        make_drive(folder, made, mass=mass, seed=100 * seed + k, style=style, duration=1500.0)
        folders.append(folder)
    known = folders[: len(KNOWN)]
    base = wb.Vehicle(name=kind, kind=CLASSES.get(kind, "car"))
    car = wb.calibrate(
        [wb.read_drive(f) for f in known], [masses(f)[0] for f in known], vehicle=base
    )
    for folder in folders[len(KNOWN) :]:
        drive, true = wb.read_drive(folder), float(np.mean(masses(folder)))
        for method in METHODS:
            try:
                found = wb.weigh(drive, car, method)
                yield method, found.mass / true - 1.0, found.std / true, np.isfinite(found.mass)
            except WeighbridgeError:
                yield method, np.nan, np.nan, False


def vehicles() -> str:
    """Write the table of the methods on vehicles of the second model."""
    found = []
    for k, kind in enumerate(KINDS):
        with tempfile.TemporaryDirectory() as root:
            found += weighed(Path(root), kind, SEED + k)
    count = len(found) // len(METHODS)
    lines = [
        HEAD,
        "",
        f"{count} drives of {len(KINDS)} vehicles of the second model (`studies/second_model`), "
        f"seeds {SEED} to {SEED + len(KINDS) - 1},",
        "with all sensors. Each vehicle is calibrated once, by `calibrate` on three ordinary",
        "drives of known mass.",
        "",
        "| method | weighed | RMS % | mean % | worst % | 95 % intervals that hold | (error/std)² |",
        "|---|---|---|---|---|---|---|",
    ]
    for method, name in METHODS.items():
        part = np.array([(e, s) for m, e, s, got in found if m == method and got])
        error, scaled = 100.0 * part[:, 0], part[:, 0] / part[:, 1]
        lines.append(
            f"| {name} | {len(part)} of {count} | {np.sqrt(np.mean(error**2)):.2f} "
            f"| {np.mean(error):+.2f} | {np.max(np.abs(error)):.1f} "
            f"| {100.0 * np.mean(np.abs(scaled) < 1.96):.0f} % | {np.mean(scaled**2):.2f} |"
        )
    return "\n".join(lines) + "\n"


def differing(page: str, made: str) -> list[str]:
    """Return the lines of a run that a page has otherwise."""
    there = set(page.split(HEAD)[0].splitlines())
    lines = [line for line in made.splitlines() if line not in there]
    return [line for line in lines if not any(word in line for word in TIME)]


def main(words: list[str]) -> int:
    """Write the page, or compare it with a run."""
    if "--vehicles" in words:
        table = vehicles()
        PAGE.write_text(PAGE.read_text(encoding="utf-8").split(HEAD)[0] + table, encoding="utf-8")
        return 0
    text = rows()
    page = PAGE.read_text(encoding="utf-8")
    if "--check" in words:
        found = differing(page, text)
        for name in found:
            print(f"differs from {PAGE.name}: {name}")
        return int(bool(found))
    _, head, tail = page.partition(HEAD)
    PAGE.write_text(f"{text}\n{head}{tail}", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
