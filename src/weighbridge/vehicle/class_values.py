"""What vehicles of a class have in common, for what nothing is known of."""

from __future__ import annotations

from typing import Final

import numpy as np

from weighbridge.signals import Floats
from weighbridge.vehicle.model import VehicleClass

ROAD_PRIOR: Final[dict[VehicleClass, tuple[Floats, Floats]]] = {
    "car": (np.array([0.65, 0.010, 0.15, 5.0]), np.array([0.25, 0.004, 0.06, 0.7])),
    "van": (np.array([1.30, 0.010, 0.30, 8.0]), np.array([0.50, 0.004, 0.12, 1.5])),
    "bus": (np.array([5.0, 0.008, 2.0, 80.0]), np.array([1.5, 0.003, 0.8, 20.0])),
    "truck": (np.array([5.5, 0.007, 2.5, 110.0]), np.array([1.5, 0.003, 1.0, 30.0])),
}
"""C_d A [m^2], C_r [-], I_e and I_w [kg m^2] of a class and their standard deviations:
Gillespie, Fundamentals of Vehicle Dynamics, 1992, ch. 4; I_e as in Jensen 2022, sec. 7.3,
for cars and in proportion to engines for the others. I_w is that of all wheels: those of
a car weigh 17 to 22 kg with a radius of gyration of 0.25 m, 1.1 to 1.4 kg m^2 each, a
truck's 100 kg and 0.4 m, 16 kg m^2 each."""

MOTOR_INERTIA: Final = (0.045, 0.02)
"""Rotor with reduction gear of an electric drive with one gear, at the motor, and its
standard deviation [kg m^2]: rotors of 20 kg and 0.16 m across weigh in with 0.06, small
ones with 0.02."""


def road_prior(kind: VehicleClass, *, single_speed: bool) -> tuple[Floats, Floats]:
    """Return C_d A, C_r, I_e, I_w of a class and their standard deviations (4,)."""
    mean, std = (values.copy() for values in ROAD_PRIOR[kind])
    if single_speed:
        share = mean[2] / ROAD_PRIOR["car"][0][2]
        mean[2], std[2] = share * MOTOR_INERTIA[0], share * MOTOR_INERTIA[1]
    return mean, std
