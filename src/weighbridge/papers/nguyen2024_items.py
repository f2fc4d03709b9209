"""Every equation, table and figure of Nguyen 2024: where it is, and our figure."""

from __future__ import annotations

from typing import Final

from weighbridge.papers.claims import Item

_RIDE: Final = "`simulation/ride.py`"
_FILTER: Final = "`kernels/kalman_bucy.py`"
_OURS: Final = "`kernels/inertia.py`"
_STILL: Final = (
    "A_02 = 0 and Q and R: the parameters never move, whatever Q and R are; the sixth of Q is not "
    "printed"
)
_TABLE_2: Final = "4.18 / 3.29 / 3.51 %"


def _rule(item: str, where: str, departure: str = "", *, as_printed: bool = True) -> Item:
    """Write an equation or a rule that has no figure of its own."""
    return Item(item, where, as_printed, departure, "", "", True)


def _followed(code: str, words: str, way: str, why: str) -> tuple[Item, ...]:
    """Write what Table 2 and sec. 5 have besides the MAPE of the parameters, by one filter."""
    ours = code == "ours"
    where = _OURS if ours else f"{_FILTER}, `{way}`"
    return tuple(
        Item(f"{item}{words}", where, code == "as printed", why, theirs, f"{{{name} {code}}}",
             not ours)
        for item, theirs, name in (
            ("table 2, RMSE", "509.4 kg / 566.7 / 1829.5 kg m²", "rmse"),
            ("table 2, RMSE of the velocities", "0.007 m/s / 0.014 / 0.012 rad/s",
             "velocity rmse"),
            ("table 2, MAPE of the velocities", "3.50 / 1.21 / 0.851 %", "velocity mape"),
            ("sec. 5, within 10 % for good after a change", "0.5 s", "near"),
        )
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
    _rule("sec. 4: w, v", _RIDE, "read as standard deviations of accelerations and of single "
          "samples; `--set shake=, body_noise=`"),
    _rule("sec. 4: Q, R", "`--set process_densities=, noise_densities=`", "five of the six numbers "
          "of Q are printed; in reproduce `printed_process`, `printed_noise`"),
    Item("table 2, MAPE, as printed", f"{_FILTER}, `printed`", True, _STILL, _TABLE_2,
         "{mape as printed}", True),
    *_followed("as printed", ", as printed", "printed", _STILL),
    Item("table 2, MAPE, Q and R as printed", f"{_FILTER}, `extended`", False, "with the Jacobian, "
         "without which nothing moves; 1 kg²/s cannot follow tonnes", _TABLE_2,
         "{mape printed noise}", True),
    *_followed("printed noise", ", Q and R as printed", "extended", "with the Jacobian"),
    Item("sec. 4.1, MAPE, R a hundredth", f"{_FILTER}, `extended`", False, "with the Jacobian; Q "
         "as printed", "lower R over Q: faster and calmer", "{mape lower noise}", True),
    Item("sec. 4.1, MAPE, R a hundred times", f"{_FILTER}, `extended`", False, "the same", "",
         "{mape higher noise}", True),
    Item("table 2, MAPE, Q per parameter, extended", f"{_FILTER}, `extended`", False, "with the "
         "Jacobian; Q relative to each parameter, R that of the sensors", _TABLE_2,
         "{mape extended}", True),
    *_followed("extended", ", extended", "extended", "Q per parameter, as above"),
    Item("table 2, MAPE, Q per parameter, inverse", f"{_FILTER}, `inverse`", False, "parameters in "
         "inverse form, exactly linear", _TABLE_2, "{mape inverse}", True),
    *_followed("inverse", ", inverse", "inverse", "Q per parameter, as above"),
    Item("table 2, MAPE, noise read as variance", _OURS, False, "hypotheses of jumps in place of a "
         "fixed Q; v as variance drowns the velocities", _TABLE_2, "{mape variance}", True),
    Item("figs. 5, 6", "the report's figures", False, "by the paper's filter, `extended` with Q "
         "per parameter, and by ours, hypotheses of jumps", "", "", True),
    Item("table 2, MAPE", _OURS, False, "hypotheses of jumps in place of a fixed Q", _TABLE_2,
         "{mape}", False),
    *_followed("ours", "", "", "the same; single samples near zero, by which eq. 10 divides, make "
               "most of the MAPE of the velocities"),
    Item("table 2, MAPE, ordinary sensors at 500 Hz", _OURS, False, "noise in the suspension's "
         "signals too, which the paper has none of", _TABLE_2, "{mape ordinary}", False),
)  # fmt: skip
"""In the paper's order; mass / roll / pitch, median of the roads unless said."""
