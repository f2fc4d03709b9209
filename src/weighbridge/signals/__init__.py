"""Signals, drives and their units: the words everything else is said in."""

from weighbridge.signals.catalogue import QUANTITIES, Quantity
from weighbridge.signals.drive import Drive, DriveInfo, Problem
from weighbridge.signals.signal import Bools, Floats, Ints, Signal

__all__ = [
    "QUANTITIES",
    "Bools",
    "Drive",
    "DriveInfo",
    "Floats",
    "Ints",
    "Problem",
    "Quantity",
    "Signal",
]
