"""Forces against motion: where every torque source and every motion source ends."""

from weighbridge.balance.force_balance import (
    REASON_TEXT,
    ForceBalance,
    ForceSide,
    MergedView,
    Reason,
    force_balance,
)

__all__ = [
    "REASON_TEXT",
    "ForceBalance",
    "ForceSide",
    "MergedView",
    "Reason",
    "force_balance",
]
