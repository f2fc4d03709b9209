"""Every equation, table and figure of Nguyen 2024: where it is, and our figure."""

from __future__ import annotations

from typing import Final

from weighbridge.papers.claims import Item

_RIDE: Final = "`simulation/ride.py`"
_FILTER: Final = "`kernels/kalman_bucy.py`"
_OURS: Final = "`kernels/inertia.py`"
_TABLE_2: Final = "4.18 / 3.29 / 3.51 %"


def _rule(item: str, where: str, departure: str = "", *, as_printed: bool = True) -> Item:
    """Write an equation or a rule that has no figure of its own."""
    return Item(item, where, as_printed, departure, "", "", True)


def _followed(way: str) -> tuple[Item, ...]:
    """Write what Table 2 and sec. 5 have besides the MAPE, by a filter with a fixed Q."""
    why, where = "Q per parameter, as above", f"{_FILTER}, `{way}`"
    return (
        Item(f"table 2, RMSE, {way}", where, False, why, "509.4 kg / 566.7 / 1829.5 kg m²",
             f"{{rmse {way}}}", True),
        Item(f"table 2, RMSE of the velocities, {way}", where, False, why,
             "0.007 m/s / 0.014 / 0.012 rad/s", f"{{velocity rmse {way}}}", True),
        Item(f"sec. 5, within 10 % after a change, {way}", where, False, why, "0.5 s",
             f"{{near {way}}}", True),
    )  # fmt: skip


ITEMS: Final = (
    _rule("eqs. 1, 2", _RIDE, "pitch nose up, where the paper has it nose down"),
    _rule("eqs. 3-5", _RIDE, "stepped exactly at the rate of the sensors; the 7 DOF and the "
          "matrices are the paper's. Axle roll inertias are not printed: m_u (0.8 t)²",
          as_printed=False),
    _rule("eqs. 6, 7", "`inertia/filter.py`"),
    _rule("eq. 8, A_02 = 0", f"{_FILTER}, `--method printed`"),
    _rule("eq. 9", f"{_FILTER}, `--method extended`", "with the Jacobian in A_02: as printed the "
          "parameters never move; `--method inverse` is linear instead", as_printed=False),
    _rule("eq. 10", "`papers/nguyen2024.py`: `judge`"),
    _rule("fig. 1, fig. 2", _RIDE),
    _rule("figs. 3, 4", "`inertia/filter.py`", "1000 steps per second in place of Simulink's "
          "continuous time", as_printed=False),
    _rule("table 1", "`simulation/ride.py`: TRUCK", "t_f and t_r are half of the printed 2 t_f "
          "and 2 t_r"),
    _rule("sec. 4: road, start, changes", "`papers/nguyen2024.py`", "speed (60 km/h), end (20 s) "
          "and P(0) are not printed: chosen; `--set speed=, start=, change_times=`",
          as_printed=False),
    _rule("sec. 4: Q, R", "`--set process_densities=, noise_densities=`", "five of the six numbers "
          "of Q are printed; in reproduce `printed_process`, `printed_noise`"),
    Item("table 2, MAPE, A_02 = 0, Q and R as scaled", f"{_FILTER}, `printed`", True, "",
         _TABLE_2, "{mape as printed}", True),
    Item("table 2, MAPE, Q and R as printed", f"{_FILTER}, `extended`", False, "with the Jacobian, "
         "without which nothing moves; 1 kg²/s cannot follow tonnes", _TABLE_2,
         "{mape printed noise}", True),
    Item("sec. 4.1, MAPE, R a hundredth", f"{_FILTER}, `extended`", False, "with the Jacobian; Q "
         "as printed", "lower R over Q: faster and calmer", "{mape lower noise}", True),
    Item("sec. 4.1, MAPE, R a hundred times", f"{_FILTER}, `extended`", False, "the same", "",
         "{mape higher noise}", True),
    Item("table 2, MAPE, Q per parameter", f"{_FILTER}, `extended`", False, "with the Jacobian; Q "
         "relative to each parameter, R that of the sensors", _TABLE_2, "{mape extended}", True),
    Item("table 2, MAPE, Q per parameter", f"{_FILTER}, `inverse`", False, "parameters in inverse "
         "form, exactly linear", _TABLE_2, "{mape inverse}", True),
    *_followed("extended"),
    *_followed("inverse"),
    Item("table 2, MAPE, noise read as variance", _OURS, False, "hypotheses of jumps in place of a "
         "fixed Q; v as variance drowns the velocities", _TABLE_2, "{mape variance}", True),
    Item("figs. 5, 6", "the report's figures", False, "by the paper's filter, `extended` with Q "
         "per parameter, and by ours, hypotheses of jumps", "", "", True),
    Item("table 2, MAPE", _OURS, False, "hypotheses of jumps in place of a fixed Q", _TABLE_2,
         "{mape}", False),
    Item("table 2, RMSE", _OURS, False, "the same", "509.4 kg / 566.7 / 1829.5 kg m²",
         "{rmse}", False),
    Item("table 2, RMSE of the velocities", _OURS, False, "the same",
         "0.007 m/s / 0.014 / 0.012 rad/s", "{velocity rmse}", False),
    Item("table 2, MAPE of the velocities", _OURS, False, "the same; single samples near zero, by "
         "which eq. 10 divides, make most of it", "3.50 / 1.21 / 0.851 %", "{velocity mape}",
         False),
    Item("fig. 6, time to follow a change", _OURS, False, "the same; within 5 % for good",
         "0.5 s, within 10 %", "{settled}", False),
    Item("table 2, MAPE, ordinary sensors at 500 Hz", _OURS, False, "noise in the suspension's "
         "signals too, which the paper has none of", _TABLE_2, "{mape ordinary}", False),
)  # fmt: skip
"""In the paper's order; mass / roll / pitch, median of the roads unless said."""
