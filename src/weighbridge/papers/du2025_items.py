"""What Du et al. 2025 says, item by item, and where it is."""

from __future__ import annotations

from typing import Final

from weighbridge.papers.claims import Item
from weighbridge.papers.du2025_claims import CLAIMS, paper_work
from weighbridge.papers.du2025_methods import METHODS, PAPER_RMSE, PAPER_TIME

_LAW = "balance/law.py"
_LEAST = "estimators/robust_rls.py, kernels/robust_rls.py"
_KALMAN = "estimators/ekf.py, kernels/mass_ekf.py"
_BLEND = "estimators/hybrid.py, kernels/hybrid_mass.py"
_TABLES = "papers/du2025.py, table of the settings as printed"

_MODEL: Final = (
    Item("eqs. 1, 8", _LAW, False, "rotating parts are added, for both filters; the paper has "
         "them in the Kalman filter alone", "", "", True),
    Item("eq. 2", f"{_LAW}: traction_gain", True, "", "", "", True),
    Item("eq. 3", f"{_LAW}: drag_force", False, "a reported wind counts; without one the speed "
         "alone, as printed", "", "", True),
    Item("eqs. 4, 6, 7", f"{_LAW}: mass_column", False, "sine and cosine in place of small angles",
         "", "", True),
    Item("eq. 5", f"{_LAW}: mass_column", True, "", "", "", True),
    Item("eq. 9", "estimators/robust_rls.py: as_set", False, "the term of bends is off until "
         "sensor_ahead tells where the sensor sits; in a city it matters (studies/du2025.md)", "",
         "", True),
    Item("eq. 10", "navigation", False, "the vertical reading is not used for the grade: its "
         "cosine hardly moves; pitch comes of all axes, height and speed", "", "", True),
    Item("eq. 11", f"{_LAW}: mass_column", True, "", "", "", True),
    Item("eqs. 12, 14", f"{_LEAST}: rows", False, "the reading holds the grade already; printed, "
         "it counts twice (setting count_grade_twice)", "", "", True),
)  # fmt: skip

_FILTERS: Final = (
    Item("eqs. 13, 15", f"{_LEAST}: fold", False, "means over 0.5 s and forgetting by time that "
         "stops in a cruise; window=0, forgetting=0.999 and kept_information=0 are as printed "
         "(printed.ekf.start.forgetting and its like in reproduce)",
         "", "", True),
    Item("eqs. 16-19", f"{_LEAST}: fold", False, "the threshold counts in standard deviations of "
         "the innovation; the paper gives no c", "", "", True),
    Item("eq. 20", f"{_LEAST}: fold", False, "the weight counts in the covariance, too; "
         "weight_information=false is as printed. An offset of the force is a second parameter; "
         "offset_std=0 leaves it out", "", "", True),
    Item("eqs. 21, 25", f"{_KALMAN}: MassEkfState", False, "a fourth state, the offset of the "
         "measured grade; grade_offset=0 and offset_walk=0 leave it out", "", "", True),
    Item("eqs. 22-24", f"{_KALMAN}: acceleration", False, "mean force of two rows; where rows are "
         "not usable the speed is taken as measured", "", "", True),
    Item("eqs. 26-28", f"{_KALMAN}: acceleration", False, "exact derivatives: that by the mass "
         "has the rotating parts, that by the grade the whole weight over the inertia", "", "",
         True),
    Item("eqs. 29-33", f"{_KALMAN}: step, fold", False, "Joseph's form, one measurement after the "
         "other; Q and R are not printed and are chosen. P0 is typically the identity by sec. 3.2, "
         "which is 1 kg² of mass; ours is 30 % of it (printed.ekf.start_std)", "", "", True),
    Item("sec. 3.2, P0 = I, table 2, ekf", f"{_KALMAN}; papers/du2025.py", False, "printed "
         "settings, the first mass ± 1 kg: at no, half and full load", "299 / 389 / 275 kg",
         "f = 0.0005: {printed_unit_start}; f = 0.005: {tenfold_unit_start}; f of the tyres: "
         "{tyres_unit_start}", True),
    Item("secs. 3.3, 4.2: starts", "estimators/robust_rls.py, estimators/ekf.py: start_mass", True,
         "the least squares start from 0 kg, the Kalman filter from their first estimate; which is "
         "first is not told (first_information)", "", "", True),
    Item("eq. 34", f"{_BLEND}: step", False, "blend=speed is as printed; by default the share "
         "follows how well each filter foretold the forces", "", "", True),
)  # fmt: skip

_FIGURES: Final = (
    Item("figs. 1-3", "docs/methods/du2025.md", True, "", "", "", True),
    Item("fig. 4", "papers/du2025_panels.py: share_panel", False, "h(v) is only drawn there; a "
         "logistic curve, one half at 21.6 km/h, nothing above 40 km/h", "", "", True),
    Item("figs. 5-7", "papers/du2025_panels.py: mass_panel, motion_panels", False, "a simulated "
         "bus of ours in place of TruckSim's", "", "", True),
    Item("secs. 4.1, 4.2: signals, road", "papers/du2025_bus.py: simulate", False, "100 Hz as "
         "there; its smoothing is not told, ours is that of any drive. No wheel spins, whatever "
         "the adhesion of 0.85", "", "", True),
    Item("table 1", "papers/du2025_bus.py: data_sheet", False, "air of 1013 hPa and 10 °C in place "
         "of 1.206 kg/m³; gear ratios and inertias are not printed. f = 0.0005 is told to the "
         "filters as printed alone; the simulated tyres have 0.0075, as buses do", "", "", True),
)  # fmt: skip

_CODES: Final = {m: m.replace("-", "_") for m in METHODS}


_OTHER_TYRES: Final = "another simulator and other tyres"
_TYRES: Final = dict.fromkeys(METHODS, _OTHER_TYRES) | {
    METHODS[0]: f"{_OTHER_TYRES}: f off by some 0.003 gives the paper's row of the least squares"
}


def _masses() -> tuple[Item, ...]:
    """Table 2, by the printed settings and by ours."""
    like, other = [], []
    for load, theirs in PAPER_RMSE.items():
        for method, rmse in zip(METHODS, theirs, strict=True):
            name = f"{_CODES[method]}_{load.replace('-', '_')}"
            item = f"table 2, {load}, {method}"
            like.append(
                Item(item, _TABLES, False, _TYRES[method], f"{rmse:.0f} kg",
                     f"f = 0.0005: {{printed_{name}}}; f = 0.005: {{tenfold_{name}}}; f of the "
                     f"tyres: {{tyres_{name}}}", True)
            )  # fmt: skip
            other.append(
                Item(item, "papers/du2025.py", False, "our filters, told the tyres' rolling "
                     "resistance; then calibrated, with all effects", f"{rmse:.0f} kg",
                     f"{{ours_{name}}}; all effects: {{road_{name}}}", False)
            )  # fmt: skip
    return (*like, *other)


def _times() -> tuple[Item, ...]:
    """Table 2, computing time."""
    return tuple(
        Item(f"table 2, time, {load}, {method}", "papers/du2025.py", False, "compiled, on another "
             "computer, processor time; forces and motion given", f"{seconds:.1f} s",
             f"{{seconds_{_CODES[method]}_{load.replace('-', '_')}}}", False)
        for load, times in PAPER_TIME.items()
        for method, seconds in zip(METHODS, times, strict=True)
    )  # fmt: skip


def _texts() -> tuple[Item, ...]:
    """What the text says of the methods, each sentence by the settings as printed."""
    where = "papers/du2025_claims.py"
    same = "another simulator and other tyres"
    return tuple(
        Item(each.item, where, False, f"{each.departure}; {same}" if each.departure else same,
             each.theirs, f"f = 0.0005: {{printed_{each.code}}}; f = 0.005: "
             f"{{tenfold_{each.code}}}; f of the tyres: {{tyres_{each.code}}}", True)
        for each in CLAIMS
    )  # fmt: skip


_TEXT: Final = (
    *_texts(),
    Item("sec. 5, largest error after convergence, printed settings", _TABLES, False, "all methods "
         "and drives; another simulator and other tyres", "below 10 %", "f = 0.0005: "
         "{printed_largest_of_all}; f = 0.005: {tenfold_largest_of_all}; f of the tyres: "
         "{tyres_largest_of_all}", True),
    Item("sec. 5, largest error after convergence", "papers/du2025.py", False, "our filters, told "
         "the tyres' rolling resistance; then calibrated, with all effects", "below 10 %",
         "{ours_largest}; all effects: {road_largest}", False),
    Item("sec. 4.2, computing time of the Kalman filter and of the hybrid", "papers/du2025.py",
         False, "compiled, our filters; the hybrid runs both parts", paper_work(), "{work}", False),
)  # fmt: skip

ITEMS: Final = (*_MODEL, *_FILTERS, *_FIGURES, *_masses(), *_TEXT, *_times())
"""Every equation, table and figure of the paper."""
