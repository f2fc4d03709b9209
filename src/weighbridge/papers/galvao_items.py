"""Every equation, table and figure of Galvão et al.: where it is, and our figure."""

from __future__ import annotations

from typing import Final

from weighbridge.papers.claims import Item

_MODEL: Final = "`vehicle/speed_model.py`"
_FILTER: Final = "`kernels/speed_ekf.py`, `estimators/speed_ekf.py`"
_STUDY: Final = "`papers/galvao.py`"
_SEEDED: Final = "started at the mass of the calibration, which the filter gives back: no weighing"

_TORQUE: Final = "`papers/galvao_torque.py`, `estimators/speed_torque_ekf.py`"
_RECORDED: Final = "engine load at 4 Hz in place of eq. 18, started at 1500 kg; Test 01 calibrates"


def _rule(item: str, where: str, departure: str = "", *, as_printed: bool = True) -> Item:
    """Write an equation or a rule that has no figure of its own."""
    return Item(item, where, as_printed, departure, "", "", True)


ITEMS: Final = (
    _rule("eqs. 1-11", _MODEL),
    _rule("eqs. 12-14, torque by eq. 18", _FILTER, "`--set sample_time=` is T_s; the constants of "
          "sec. 2.1 are `model.force_gain` and its like"),
    _rule("eq. 13, torque as its input", "`estimators/speed_torque_ekf.py`", "the recorded torque "
          "in place of eq. 18, and the grade as a walk: the version that weighs", as_printed=False),
    _rule("eqs. 15-18", "`calibration/speed_fit.py`"),
    _rule("eqs. 19-26", "`kernels/speed_ekf.py`"),
    _rule("figs. 1-3", _FILTER),
    _rule("fig. 4, mean mass", "`estimators/speed_ekf.py`: `mean_mass`", "ten groups of the last "
          "three quarters, of which the paper tells neither: `printed.groups`, `printed.tail`"),
    _rule("sec. 4, on and off", "`balance/speed_balance.py`", "the paper has no limits: off "
          "below 5 m/s in the mean, or slowed by more than 0.4 m/s²", as_printed=False),
    _rule("sec. 5.1: tests", f"{_STUDY}: `easy_route`", "one simulated road of few bends, driven "
          "three times; its grade is known to the fit", as_printed=False),
    _rule("figs. 5, 6", "none", "not in the text that was read; its sec. 5.1 names neither",
          as_printed=False),
    Item("figs. 7-9, model speed", "the report's figures", True, "", "superimposed",
         "R² of the change of speed {r squared}", True),
    Item("figs. 10, 12, 14; table 1, X_0, Q, R as printed", _STUDY, True, "",
         "errors 0.0069 / 0.33 / 0.0025 %", "{printed errors}", True),
    Item("figs. 11, 13, 15, X_0, Q, R as printed", "the report's figures", True, "",
         "converge within 5 min", "{printed late errors}", True),
    Item("table 2, band of the last 200 samples, as printed", _STUDY, True, "20 minutes have 171 "
         "samples of 7 s: all that are used",
         "± 100 / 200 / 200 kg", "{printed bands}", True),
    Item("table 1", _STUDY, False, _SEEDED, "errors 0.0069 / 0.33 / 0.0025 %", "{errors}", False),
    Item("table 2", _STUDY, False, f"the band of the start; {_SEEDED}", "± 100 / 200 / 200 kg",
         "{bands}", False),
    Item("table 1, torque recorded (eq. 13), no grade", _TORQUE, False, f"{_RECORDED}; the grade "
         "is a state, in the calibration too", "errors 0.0069 / 0.33 / 0.0025 %",
         "{blind torque errors}", False),
    Item("table 1, torque recorded (eq. 13), no grade, calibrated with a grade", _TORQUE, False,
         f"{_RECORDED} with the true grade, as the paper's fit; what the calibration is surer of "
         "is in the mass", "errors 0.0069 / 0.33 / 0.0025 %", "{mixed torque errors}", False),
    Item("table 1, torque recorded (eq. 13), grade of a map", _TORQUE, False, f"{_RECORDED}; the "
         "true grade is known", "errors 0.0069 / 0.33 / 0.0025 %", "{torque errors}", False),
    Item("eq. 13, torque recorded, electric cars, grade of a map", _TORQUE, False, "the motor's "
         "torque; 24 drives of six cars, their figures in studies/galvao.md", "", "", False),
    Item("speed alone: upper bound of the mass", "`weighbridge bound`, `wb.mass_bound`", False,
         "no mass: the three tests by the engine's full power, grade of a map", "", "{bounds}",
         False),
    Item("speed alone: C_d A over the mass", "`weighbridge coast`, `wb.coast_down`", False, "no "
         "mass: three coast-downs each way, wind of 3 ± 0.5 m/s, whole km/h", "", "{coast}", False),
    Item("mass as an answer to other loads", _STUDY, False, "the paper tried none", "",
         "{slope} kg found per kg loaded", False),
    Item("mass as an answer to other loads, torque recorded", _TORQUE, False, "the paper tried "
         "none; five drives, one of 200 and one of 400 kg, grade of a map", "",
         "{torque slopes} kg found per kg loaded", False),
)  # fmt: skip
"""In the paper's order."""
