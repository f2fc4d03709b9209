"""Every equation, table and figure of Du et al. 2025: where it is, and what is compared."""

from __future__ import annotations

from typing import Final

from weighbridge.papers.claims import Conditions, Item, items_of, read_rows
from weighbridge.papers.du2025_claims import paper_work
from weighbridge.papers.du2025_methods import METHODS, PAPER_RMSE, PAPER_TIME

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
