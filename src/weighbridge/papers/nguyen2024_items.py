"""Every equation, table and figure of Nguyen 2024: where it is, and what is compared."""

from __future__ import annotations

from typing import Final

from weighbridge.papers.claims import EXACT, Conditions, Item, listed

_RIDE: Final = "`simulation/ride.py`"
_FILTER: Final = "`kernels/kalman_bucy.py`"
_COMMAND: Final = "weighbridge reproduce nguyen2024"
_STILL: Final = (
    "with A_02 = 0 the covariance between velocities and parameters stays zero: the parameters "
    "never move, whatever Q and R are"
)
_LARGER_Q: Final = f"{_COMMAND} --set printed_process=1e6,1e6,1e6,1e6,1e6,1e6"
_SMALL_Q: Final = (
    "with the Jacobian, without which nothing moves; 1 kg²/s cannot follow tonnes, and R is far "
    "above the noise of the sensors"
)
_FOLLOWING_Q: Final = (
    f"{_COMMAND} --set printed_process=1e-6,1e-6,1e-6,3e5,2e5,4e6 "
    "--set printed_noise=1e-9,1e-11,1e-11"
)
_CHOSEN_Q: Final = (
    "Q is chosen: 0.01 per second of each parameter's square, R that of the sensors "
    "(`process`, `noise_densities`)"
)
_AT_MOST: Final = "not above print, median of 20 roads: the paper has one road"
_JUMPS: Final = "hypotheses of jumps in place of a fixed Q"

TABLE_2: Final = {
    "mape": ("MAPE of mass, roll and pitch", "4.18 / 3.29 / 3.51 %"),
    "rmse": ("RMSE of mass, roll and pitch", "509.4 kg / 566.7 / 1829.5 kg m²"),
    "velocity rmse": ("RMSE of the velocities", "0.007 m/s / 0.014 / 0.012 rad/s"),
    "velocity mape": ("MAPE of the velocities", "3.50 / 1.21 / 0.851 %"),
}
"""What Table 2 prints, by the name of our figure."""

_STAYS: Final = "table 2, MAPE with A_02 = 0, which stays"
_ABOVE: Final = "the RMSE of the velocities, which is below print"
_ZEROS: Final = "samples near zero, by which eq. 10 divides, make most of it"


def _equation(number: int, where: str, why: str = "") -> Item:
    return Item(
        item=f"eq. {number}", where=where, ours=f"{{eq {number}}}", tolerance=EXACT, why=why
    )


def _drawing(number: int, why: str) -> Item:
    return Item(item=f"fig. {number}", where="docs/methods/nguyen2024.md", why=why)


def _followed(
    code: str,
    words: str,
    where: str,
    why: str,
    check: str,
    conditions: Conditions,
    seen: str = "",
) -> tuple[Item, ...]:
    """Write what Table 2 and sec. 5 state, by one filter."""
    rows = [
        Item(
            item="table 2", what=f"{what}, {words}", conditions=conditions, where=where,
            printed=printed, ours=f"{{{name} {code}}}", tolerance=_AT_MOST,
            why=listed(why, _ZEROS) if name == "velocity mape" else why, check=check,
            seen=_ABOVE if name == "velocity mape" else seen,
        )
        for name, (what, printed) in TABLE_2.items()
    ]  # fmt: skip
    rows.append(
        Item(
            item="sec. 5", what=f"within 10 % for good after a change, {words}",
            conditions=conditions, where=where, printed="0.5 s", ours=f"{{near {code}}}",
            tolerance="the median change not later than print: the paper has two changes",
            why=why, check=check, seen=seen,
        )
    )  # fmt: skip
    return tuple(rows)


PRINTED, OURS = Conditions.PRINTED, Conditions.OURS

ITEMS: Final = (
    *(_equation(n, _RIDE, "pitch is nose up, where the paper has it nose down") for n in (1, 2)),
    _equation(3, _RIDE, "stepped exactly at the rate of the sensors"),
    _equation(4, _RIDE, "axle roll inertias are not printed: m_u (0.8 t)²"),
    _equation(5, _RIDE),
    _equation(6, "`inertia/filter.py`"),
    _equation(7, f"{_FILTER}, `printed`"),
    _equation(8, f"{_FILTER}, `printed`", "A_02 = 0"),
    _equation(9, f"{_FILTER}, `printed`", "a step of 1 ms in place of continuous time"),
    Item(
        item="eq. 9", what="with the Jacobian in A_02", conditions=OURS,
        where=f"{_FILTER}, `extended`", ours="{eq 9 ours}", tolerance=EXACT,
        why=_STILL, check=_LARGER_Q, seen=_STAYS,
    ),
    _equation(10, "`papers/nguyen2024_judged.py`"),
    *(_drawing(n, "a drawing of the model, without numbers") for n in (1, 2)),
    *(_drawing(n, "a block diagram of eq. 9, without numbers") for n in (3, 4)),
    Item(
        item="fig. 5", what="velocities on their true values", where="the report's figures",
        printed=TABLE_2["velocity rmse"][1], ours="{velocity rmse printed noise}",
        tolerance=_AT_MOST, why=_SMALL_Q, check=_FOLLOWING_Q,
    ),
    Item(
        item="fig. 6", what="parameters on their true values", where="the report's figures",
        printed=TABLE_2["mape"][1], ours="{mape printed noise}", tolerance=_AT_MOST, why=_SMALL_Q,
        check=_FOLLOWING_Q,
    ),
    Item(
        item="fig. 5", what="velocities on their true values", conditions=OURS,
        where="the report's figures", printed=TABLE_2["velocity rmse"][1],
        ours="{velocity rmse extended}", tolerance=_AT_MOST, why=_CHOSEN_Q,
    ),
    Item(
        item="fig. 6", what="parameters on their true values", conditions=OURS,
        where="the report's figures", printed=TABLE_2["mape"][1], ours="{mape extended}",
        tolerance=_AT_MOST, why=_CHOSEN_Q,
    ),
    Item(
        item="table 1", where=f"{_RIDE}: TRUCK", ours="{table 1}", tolerance=EXACT,
        why="t_f and t_r are half of the printed 2 t_f and 2 t_r",
    ),
    Item(
        item="sec. 4.1", what="lower R over Q: faster and calmer", where=f"{_FILTER}, `extended`",
        printed="MAPE falls with R: a hundred times, once, a hundredth", ours="{sections}",
        tolerance="none: the order is the claim", why="with the Jacobian; Q as printed",
    ),
    *_followed("as printed", "A_02 = 0, Q and R as printed", f"{_FILTER}, `printed`", _STILL,
               _LARGER_Q, PRINTED, _STAYS),
    *_followed("printed noise", "Jacobian, Q and R as printed", f"{_FILTER}, `extended`", _SMALL_Q,
               _FOLLOWING_Q, PRINTED),
    *_followed("extended", "extended, Q chosen", f"{_FILTER}, `extended`", _CHOSEN_Q,
               f"{_COMMAND} --set filter.process=1e-6,0.03", OURS),
    *_followed("inverse", "inverse, Q chosen", f"{_FILTER}, `inverse`", _CHOSEN_Q,
               f"{_COMMAND} --set filter.process=1e-6,0.03", OURS),
    *_followed("ours", "our filter", "`kernels/inertia.py`", _JUMPS,
               "", OURS),
)  # fmt: skip
"""In the paper's order; mass / roll / pitch, median of the roads unless said."""
