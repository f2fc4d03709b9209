"""Signals, drives and their units: the words everything else is said in."""

from weighbridge.messages import Problem
from weighbridge.signals.catalogue import QUANTITIES, Quantity
from weighbridge.signals.drive import Drive, DriveInfo
from weighbridge.signals.recent import BEHIND, LONGEST_STEP, STEP, STEPS, instants, recent
from weighbridge.signals.signal import Bools, Floats, Ints, Signal

__all__ = [
    "BEHIND",
    "LONGEST_STEP",
    "QUANTITIES",
    "STEP",
    "STEPS",
    "Bools",
    "Drive",
    "DriveInfo",
    "Floats",
    "Ints",
    "Problem",
    "Quantity",
    "Signal",
    "instants",
    "recent",
]
