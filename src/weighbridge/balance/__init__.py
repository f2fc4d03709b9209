"""Forces against motion: where every torque source and every motion source ends."""

from weighbridge.balance.force_balance import force_balance
from weighbridge.balance.table import REASON_TEXT, ForceBalance, ForceTable, Reason

__all__ = [
    "REASON_TEXT",
    "ForceBalance",
    "ForceTable",
    "Reason",
    "force_balance",
]
