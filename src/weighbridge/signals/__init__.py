"""Signals, drives and their units: the words everything else is said in."""

from weighbridge.messages import Problem
from weighbridge.signals.alignment import Alignment, align
from weighbridge.signals.catalogue import QUANTITIES, Quantity
from weighbridge.signals.cleaning import NO_DRIVE, clean_columns, clean_signal, spread_rows
from weighbridge.signals.drive import ClockShift, Drive, DriveInfo
from weighbridge.signals.lag import (
    best_lag,
    find_lag,
    lag_std,
    lag_std_at,
    lowest,
    parabola,
)
from weighbridge.signals.minimum import lowest_by_simplex, lowest_by_slopes
from weighbridge.signals.moving import moving_mean
from weighbridge.signals.parts import find_restarts, find_splices, longest_part, numbered, parted
from weighbridge.signals.recent import (
    BEHIND,
    LONGEST_STEP,
    STEP,
    STEPS,
    recent,
    shifted,
    step_ends,
)
from weighbridge.signals.robust import (
    huber,
    median_of_three,
    median_slope,
    resolution,
    robust_fit,
    robust_fits,
    spread,
)
from weighbridge.signals.signal import Bools, Floats, Ints, Signal
from weighbridge.signals.student import student_quantile
from weighbridge.signals.units import (
    UNITS,
    Unit,
    from_si,
    scalar_from_si,
    scalar_to_si,
    to_si,
    unit,
)

__all__ = [
    "BEHIND",
    "LONGEST_STEP",
    "NO_DRIVE",
    "QUANTITIES",
    "STEP",
    "STEPS",
    "UNITS",
    "Alignment",
    "Bools",
    "ClockShift",
    "Drive",
    "DriveInfo",
    "Floats",
    "Ints",
    "Problem",
    "Quantity",
    "Signal",
    "Unit",
    "align",
    "best_lag",
    "clean_columns",
    "clean_signal",
    "find_lag",
    "find_restarts",
    "find_splices",
    "from_si",
    "huber",
    "lag_std",
    "lag_std_at",
    "longest_part",
    "lowest",
    "lowest_by_simplex",
    "lowest_by_slopes",
    "median_of_three",
    "median_slope",
    "moving_mean",
    "numbered",
    "parabola",
    "parted",
    "recent",
    "resolution",
    "robust_fit",
    "robust_fits",
    "scalar_from_si",
    "scalar_to_si",
    "shifted",
    "spread",
    "spread_rows",
    "step_ends",
    "student_quantile",
    "to_si",
    "unit",
]
