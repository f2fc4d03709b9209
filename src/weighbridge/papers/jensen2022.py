"""Jensen et al. 2022: car mass from OBD-II, IMU and GNSS, on simulated drives.

K. M. Jensen, I. F. Santos, L. K. H. Clemmensen, S. Theodorsen, H. J. P. Corstens:
Mass estimation of ground vehicles based on longitudinal dynamics using IMU and
CAN-bus data, Mechanical Systems and Signal Processing 171, 2022, 108925.

Each drive is weighed twice: by the paper's own rules, as printed, and by ``rls`` as
weighbridge has it, with its own navigation and calibration.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Final

from weighbridge.papers.claims import Item, items_of, listed, read_rows
from weighbridge.papers.jensen2022_drives import TABLE_B1, scenario
from weighbridge.papers.jensen2022_found import found
from weighbridge.papers.jensen2022_reproduction import SEED, Reproduction, Settings, reproduce
from weighbridge.papers.jensen2022_tables import (
    PAPER_R_SQUARED,
    PAPER_ROAD,
    PAPER_WEIGHTS,
    ROAD_UNITS,
    WEIGHT_UNITS,
    drives_table,
    highway_table,
    parameters_table,
    with_units,
)
from weighbridge.papers.reproduced import Progress, Reproduced

if TYPE_CHECKING:
    from pathlib import Path

    from weighbridge.report.table import Table

__all__ = [
    "ITEMS",
    "SEED",
    "SETTINGS",
    "TABLE_B1",
    "Settings",
    "as_reproduced",
    "reproduce",
    "reproduced",
    "scenario",
]

_OURS: Final = "our navigation, lateness, fit and rows; the wind is unknown"


def _items() -> Iterator[Item]:
    """Yield the items; ``both`` is a figure by the paper's own rules, and the same by ours."""
    rows = read_rows(
        "jensen2022",
        road=with_units(PAPER_ROAD, ROAD_UNITS),
        weights=with_units(PAPER_WEIGHTS, WEIGHT_UNITS),
        r_squared=f"{PAPER_R_SQUARED}",
    )
    for row in (row for section in rows.values() for row in section):
        name = row.pop("both", None)
        if name is None:
            yield from items_of([row])
            continue
        row = {"where": "report", **row}
        own = {key: row.pop(f"own_{key}", "") for key in ("why", "check")}
        theirs = row | {"ours": f"{{{name} printed}}"}
        own["why"] = listed(own["why"], _OURS)
        ours = row | own | {"seen": "", "ours": f"{{{name} ours}}", "conditions": "ours"}
        yield from items_of([theirs, ours])


ITEMS: Final = tuple(_items())
"""Equations, tables and figures in the order of the paper."""

SETTINGS: Final = Settings
"""What ``weighbridge reproduce jensen2022 --set`` changes."""


def reproduced(
    seed: int, progress: Progress | None, settings: Settings | None = None
) -> Reproduced:
    """Reproduce the paper and put it beside its own figures; see `reproduce`."""
    return as_reproduced(reproduce(seed=seed, progress=progress, settings=settings))


def as_reproduced(done: Reproduction) -> Reproduced:
    """Put a reproduction beside the paper's own figures."""

    def write(tables: Sequence[Table], path: Path) -> None:
        from weighbridge.papers.jensen2022_figures import panels
        from weighbridge.report import write_report

        weighings = [d.weighing for d in done.drives if d.weighing is not None]
        write_report(
            weighings,
            path,
            calibration=done.calibration,
            truth={w.drive.name: d.true_mass for d, w in zip(done.drives, weighings, strict=True)},
            title="Jensen et al. 2022, reproduced on simulated drives",
            tables=tables,
            panels=panels(done),
        )

    seeds = f"seeds {done.seed} to {done.last_seed}"
    apart = "which no choice of the weighing was made on" if done.seed >= SEED else "not held out"
    figures = found(done)
    return Reproduced(
        title="Jensen et al. 2022",
        note=f"{seeds}, {apart}",
        tables=(drives_table(done), parameters_table(done), highway_table(done)),
        # A part of the drives makes a part of the figures.
        rows=tuple(
            item.row("jensen2022", figures) for item in ITEMS if set(item.names) <= set(figures)
        ),
        write_page=write,
    )
