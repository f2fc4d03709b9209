"""Every equation, table and figure of Du et al. 2025: where it is, and what is compared."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from weighbridge.papers.claims import EXACT, Conditions, Item
from weighbridge.papers.du2025_claims import CLAIMS, paper_work
from weighbridge.papers.du2025_methods import METHODS, PAPER_RMSE, PAPER_TIME

_LAW: Final = "`balance/law.py`"
_LEAST: Final = "`kernels/robust_rls.py`"
_KALMAN: Final = "`kernels/mass_ekf.py`"
_TABLES: Final = "`papers/du2025.py`"
_COMMAND: Final = "weighbridge reproduce du2025"

_ANGLES: Final = "0.05 %: the paper's small angles at 2 % of slope"
_STEEPEST: Final = "0.4 %: the paper's small angles at its steepest slope, 8 %"
_RESISTANCE: Final = "1 %: the filter's f grows with speed, that of eq. 23 does not"


@dataclass(frozen=True, slots=True, kw_only=True)
class _Equation:
    """How one equation is compared; most to the last digits, at the rows of `point`."""

    number: int
    where: str
    ours: str = ""
    what: str = ""
    tolerance: str = EXACT
    why: str = ""
    check: str = ""
    seen: str = ""
    conditions: Conditions = Conditions.PRINTED

    @property
    def item(self) -> Item:
        """As an item."""
        return Item(
            item=f"eq. {self.number}", what=self.what, conditions=self.conditions,
            where=self.where, ours=self.ours or f"{{eq {self.number}}}", tolerance=self.tolerance,
            why=self.why, check=self.check, seen=self.seen,
        )  # fmt: skip


_TWICE: Final = "the reading holds the grade already; printed, it counts twice"
_ONCE: Final = "table of settings: RMSE with the grade once and twice"

_EQUATIONS: Final = (
    _Equation(number=1, where=_LAW),
    _Equation(number=2, where=f"{_LAW}: traction_gain"),
    _Equation(number=3, where=f"{_LAW}: drag_force", why="a reported wind counts as well"),
    _Equation(number=4, where=_KALMAN),
    _Equation(number=5, where=f"{_LAW}: mass_column"),
    _Equation(number=6, where=_KALMAN, tolerance=_STEEPEST),
    _Equation(number=7, where=_LAW, tolerance=_ANGLES),
    _Equation(number=8, where=_KALMAN, tolerance=_ANGLES),
    _Equation(number=9, where="`estimators/robust_rls.py`: as_set", what="sensor_ahead set",
              tolerance="1e-6: the yaw rate is a difference of headings",
              why="off until sensor_ahead states the place of the sensor"),
    _Equation(number=10, where="`kernels/rotation.py`"),
    _Equation(number=11, where="`kernels/rotation.py`"),
    _Equation(number=12, where=f"{_LAW}: mass_column", what="count_grade_twice",
              tolerance=_ANGLES),
    _Equation(number=12, where=f"{_LAW}: mass_column", ours="{eq 12 ours}", tolerance=_ANGLES,
              conditions=Conditions.OURS, why=_TWICE, check=_COMMAND, seen=_ONCE),
    _Equation(number=13, where=_LEAST),
    _Equation(number=14, where="`estimators/robust_rls.py`: rows", what="y", ours="{eq 14 y}"),
    _Equation(number=14, where="`estimators/robust_rls.py`: rows", what="φ, count_grade_twice",
              tolerance=_ANGLES),
    _Equation(number=14, where="`estimators/robust_rls.py`: rows", what="φ", ours="{eq 14 ours}",
              tolerance=_ANGLES, conditions=Conditions.OURS, why=_TWICE, check=_COMMAND,
              seen=_ONCE),
    _Equation(number=15, where=f"{_LEAST}: fold", what="θ and P after a row"),
    _Equation(number=16, where=f"{_LEAST}: fold", what="mass at which J is least",
              tolerance="0.5 %: recursive, the weights of early rows are not made anew"),
    _Equation(number=17, where=f"{_LEAST}: fold", what="slope of ρ beyond c",
              tolerance="1e-6: a difference quotient",
              why="read with c² in the last term; with the r² of the text at hand ρ falls beyond "
              "c, against eq. 19"),
    _Equation(number=18, where=f"{_LEAST}: fold", tolerance="1e-6: a difference quotient"),
    _Equation(number=19, where=f"{_LEAST}: fold", what="weight, threshold_force = c",
              why="the paper gives no c; by default it counts in standard deviations"),
    _Equation(number=20, where=f"{_LEAST}: fold", what="θ and P, weight_information=false"),
    _Equation(number=21, where=_KALMAN, what="grade_offset=0",
              why="ours has a fourth state, the offset of the measured grade"),
    _Equation(number=22, where=_KALMAN, tolerance=_ANGLES),
    _Equation(number=23, where=f"{_KALMAN}: acceleration", tolerance=_RESISTANCE),
    _Equation(number=24, where=f"{_KALMAN}: step"),
    _Equation(number=25, where=f"{_KALMAN}: step"),
    _Equation(number=26, where=f"{_KALMAN}: step"),
    _Equation(number=27, where=f"{_KALMAN}: acceleration", what="by one kilogram",
              tolerance="0.1 %: a difference quotient"),
    _Equation(number=28, where=f"{_KALMAN}: acceleration", what="by the speed",
              tolerance=_RESISTANCE),
    _Equation(number=28, where=f"{_KALMAN}: acceleration", what="by the slope",
              ours="{eq 28 grade}", tolerance=_ANGLES),
    _Equation(number=28, where=f"{_KALMAN}: acceleration", what="by the mass",
              ours="{eq 28 mass}",
              tolerance="3 % the rotating parts weigh, and 1 %: the paper holds δ, which depends "
              "on the mass"),
    _Equation(number=29, where=f"{_KALMAN}: step"),
    *(_Equation(number=n, where=f"{_KALMAN}: step, fold") for n in (30, 31, 32, 33)),
    _Equation(number=34, where="`kernels/hybrid_mass.py`: step", what="blend=speed"),
)  # fmt: skip

_FIGURES: Final = (
    Item(item="fig. 1", where="docs/methods/du2025.md", why="a drawing of the forces"),
    Item(item="fig. 2", where="docs/methods/du2025.md", why="a flow chart of eqs. 21 to 33"),
    Item(item="fig. 3", where="docs/methods/du2025.md", why="a flow chart of eq. 34"),
    Item(item="fig. 4", where="`papers/du2025_panels.py`", printed="h(v) falls from 1 to 0",
         ours="{fig 4}", tolerance="its ends: the curve is only drawn",
         why="a logistic curve, one half at 21.6 km/h: `blend_speed`, `blend_width`"),
    *(
        Item(item=f"fig. {n}", what=f"{load}: all three converge to the true mass",
             where="`papers/du2025_panels.py`", printed="within 10 % from 21 s",
             ours=f"{{fig {n}}}", tolerance="10 % of the mass: the paper's own bound")
        for n, load in zip((5, 6, 7), PAPER_RMSE, strict=True)
    ),
    Item(item="table 1", where="`papers/du2025_bus.py`: data_sheet", ours="{table 1}",
         tolerance=EXACT,
         why="f = 0.0005 is given to the filters alone; the simulated tyres have 0.0075, as buses "
         "do. Gear ratios and inertias are not printed, and the air has 1013 hPa and 10 °C"),
)  # fmt: skip


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


def _texts() -> tuple[Item, ...]:
    """What the text says of the methods, by the printed settings."""
    return tuple(
        Item(item=claim.section, what=claim.what, where="`papers/du2025_claims.py`",
             printed=claim.printed, ours=f"{{{claim.code}}}", tolerance=claim.tolerance,
             why=claim.departure, check=claim.check, seen=claim.seen)
        for claim in CLAIMS
    )  # fmt: skip


_BLENDED: Final = (
    Item(
        item="sec. 3.3", what="innovations, on all judged drives, over the better part",
        conditions=Conditions.OURS, where="`kernels/hybrid_mass.py`", printed="at most 1",
        ours="{innovations}", tolerance="3 %: what 9 drives of each kind can show",
        why="with all effects the least squares are better empty, the Kalman filter laden: the "
        "blend cannot know",
        check=_COMMAND, seen="table of blends",
    ),
    Item(
        item="sec. 4.3", what="half-load, a blend with a constant share beats both parts, every "
        "row, f = 0.005, Huber's threshold 0.5", where="`papers/du2025_claims.py`",
        printed="101 of 589 and 389 kg", ours="{opposite}",
        tolerance="none: the order is the claim",
        why="with errors of opposite sign a small constant share is better than both parts",
    ),
    Item(
        item="sec. 3.2", what="P0 = I: 1 kg² of mass, Table 2, ekf", where=_TABLES,
        printed="299 / 389 / 275 kg", ours="{unit start}",
        tolerance="not above print: at no, half and full load",
        why="with 1 kg² the filter hardly leaves its first mass, which brakings put off",
    ),
    Item(
        item="sec. 4.2", what="computing time of the Kalman filter and of the hybrid",
        conditions=Conditions.OURS, where=_TABLES, printed=paper_work(), ours="{work}",
        tolerance="their order: compiled, on another computer",
    ),
)  # fmt: skip

ITEMS: Final = (
    *(e.item for e in _EQUATIONS), *_FIGURES, *_masses(), *_times(), *_texts(), *_BLENDED,
)  # fmt: skip
"""In the paper's order: equations, figures, tables, and what the text says."""
