"""What the integral of the suspension's forces over a step loses at a logger's rate."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from weighbridge.inertia.filter import RideSamples, accelerations, body_noise, push_var
from weighbridge.signals import Floats
from weighbridge.vehicle import Ride

_RIDE_BAND: Final = (0.2, 25.0)
"""Frequencies of a ride, from the heave of a soft suspension to above the hop of an axle [Hz]."""


def integration_std(samples: RideSamples, ride: Ride) -> Floats:
    """Part by which the logger's rate may draw each inverse parameter.

    The parabola through three samples (weights 5, 8, -1 of 12) integrates a sine to less than
    its amplitude: one of 12 Hz, where axles hop, by 0.5 % at 100 Hz and by 0.03 % at 200 Hz.
    What is lost of the parameter is the mean over the ride's spectrum, weighted by what the
    filter learns at each frequency: the power of the velocity over that of the noise, which is
    white in the measurement and a random walk in the integral. It is the same at all times.

    Parameters
    ----------
    samples : of the ride
    ride : the vehicle's suspension

    Returns
    -------
    (3,) [-]
    """
    period = samples.period
    spring, damper = accelerations(ride)
    push = samples.travel @ spring.T + samples.rate @ damper.T
    window = np.hanning(samples.time.size)[:, np.newaxis]
    power = np.abs(np.fft.rfft(window * (push - np.mean(push, axis=0)), axis=0)) ** 2
    frequency = np.asarray(np.fft.rfftfreq(samples.time.size, period), dtype=np.float64)
    inside = (frequency >= _RIDE_BAND[0]) & (frequency <= _RIDE_BAND[1])
    turning = 2.0 * math.pi * frequency[inside, np.newaxis]
    # The kernel counts the parabola's difference from the chord as noise of a step.
    bend = (5.0 * push[2:] + 8.0 * push[1:-1] - push[:-2]) / 12.0 - 0.5 * (push[2:] + push[1:-1])
    walk = (push_var(ride) + np.mean(bend**2, axis=0)) * period
    learnt = power[inside] / (turning**2 * body_noise(ride) ** 2 * period + walk)
    lost = integration_loss(period, frequency[inside])[:, np.newaxis]
    total = np.sum(learnt, axis=0)
    return np.asarray(np.abs(np.sum(learnt * lost, axis=0)) / np.where(total > 0.0, total, 1.0))


def integration_loss(period: float, frequency: Floats) -> Floats:
    """Part of a sine's integral over a step that the parabola loses.

    Parameters
    ----------
    period : between samples [s]
    frequency : (n,) above 0 [Hz]
    """
    angle = 2.0 * math.pi * frequency * period
    turn = np.exp(-1j * angle)
    parabola = (5.0 + 8.0 * turn - turn**2) / 12.0
    exact = (1.0 - turn) / (1j * angle)
    return np.asarray(1.0 - np.abs(parabola / exact))
