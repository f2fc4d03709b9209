"""The joint estimator: the mass beside the slow errors that look like it.

`batch` weighs a whole drive, `forward` one window after another. Both ask one filter, see
`problem`, for the states of `slow_errors`.
"""

from weighbridge.estimators.joint.batch import estimate
from weighbridge.estimators.joint.settings import JointSettings

__all__ = ["JointSettings", "estimate"]
