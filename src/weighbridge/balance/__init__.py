"""Forces against motion: where every torque source and every motion source ends."""

from weighbridge.balance.averaging import PAUSE, WINDOW, Windows, window_params, windows
from weighbridge.balance.force_balance import force_balance
from weighbridge.balance.height_scale import height_scale
from weighbridge.balance.second_signal_learning import learn_second_signals
from weighbridge.balance.shaking import shaken
from weighbridge.balance.table import REASON_TEXT, ForceBalance, ForceTable, Reason

__all__ = [
    "PAUSE",
    "REASON_TEXT",
    "WINDOW",
    "ForceBalance",
    "ForceTable",
    "Reason",
    "Windows",
    "force_balance",
    "height_scale",
    "learn_second_signals",
    "shaken",
    "window_params",
    "windows",
]
