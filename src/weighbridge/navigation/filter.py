"""The navigation filter as a fold: state and samples in, state out."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from weighbridge.constants import GRAVITY
from weighbridge.kernels import ins
from weighbridge.kernels.ins_model import (
    ACCEL,
    ERRORS,
    MEASUREMENTS,
    PITCH0,
    RATE,
    S_GRADE,
    S_HEADING,
    S_SPEED,
    SHOWN,
    SQUAT,
    STDS,
    Q,
    Rows,
    Samples,
    V,
    new_rows,
)
from weighbridge.kernels.ins_smoother import smooth
from weighbridge.kernels.rotation import matrix_to_euler, quaternion_to_matrix
from weighbridge.navigation.axes import Axes
from weighbridge.navigation.state import State
from weighbridge.signals import Floats, Ints

if TYPE_CHECKING:
    from weighbridge.navigation.identify.setup import Setup

_STRETCH: Final = 512
"""Nodes the backward pass holds at a time: bounds its memory."""


class Block(NamedTuple):
    """Inertial samples in succession, with the measurements at their nodes.

    Attributes
    ----------
    time : (n,) rising [s]
    accel : (n, 3) specific force in sensor axes, corrected by `Setup.corrected` [m/s^2];
        `Axes` are put together where a part of them is taken
    gyro : (n, 3) angular rate likewise [rad/s]
    nodes : (m,) samples after which covariance and measurements are processed, rising
    z : (m, 13) their measurements, NaN where there is none; places are named ``Z_...`` in
        `weighbridge.kernels.ins_model`
    """

    time: Floats
    accel: Floats | Axes
    gyro: Floats | Axes
    nodes: Ints
    z: Floats

    def part(self, first: int, last: int) -> Block:
        """Return the samples from ``first`` up to ``last`` (excluded) with their nodes."""
        low, high = np.searchsorted(self.nodes, (first, last))
        return Block(
            self.time[first:last],
            self.accel[first:last],
            self.gyro[first:last],
            self.nodes[low:high] - first,
            self.z[low:high],
        )


class Sample(NamedTuple):
    """One inertial sample, as a row of `Block`; ``z`` (13,) is None where it is no node."""

    time: float
    accel: Floats
    gyro: Floats
    z: Floats | None = None


class Nodes(NamedTuple):
    """What the filter found, at its nodes.

    Attributes
    ----------
    time : (m,) [s]
    states : (m, 24) first part of the filter state
    grade_std : (m,) standard deviation of the grade [rad]
    """

    time: Floats
    states: Floats
    grade_std: Floats


class MotionRow(NamedTuple):
    """How the vehicle moves at one instant.

    Attributes
    ----------
    time : [s]
    speed : over ground, negative backward [m/s]
    accel : along the vehicle, low-passed over 0.15 s [m/s^2]
    specific_force : ``accel + g sin(grade)`` [m/s^2]
    grade : of the road, positive uphill [rad]
    pitch, roll, heading : of the body [rad]
    yaw_rate : to the right [rad/s]
    speed_std, grade_std, heading_std : standard deviations
    """

    time: float
    speed: float
    accel: float
    specific_force: float
    grade: float
    pitch: float
    roll: float
    heading: float
    yaw_rate: float
    speed_std: float
    grade_std: float
    heading_std: float


def run(state: State, block: Block, setup: Setup) -> tuple[State, Nodes]:
    """Fold a block of samples into the state; any split of the samples gives the same bits.

    Samples that are not finite or not later than the last one are left out; over more than
    0.5 s without samples the state is carried with the uncertainty a vehicle can make.
    """
    count = block.nodes.size
    states, stds = np.empty((count, SHOWN)), np.empty((count, STDS))
    state = _fold(state, block, setup, new_rows(), states, stds)
    return state, Nodes(block.time[block.nodes], states, stds[:, S_GRADE].copy())


def _fold(
    state: State, block: Block, setup: Setup, rows: Rows, states: Floats, stds: Floats
) -> State:
    """Fold a block into the state; fill what was found at its nodes."""
    x, cov = state.x.copy(), state.cov.ravel().copy()
    samples = Samples(
        np.ascontiguousarray(block.time),
        np.ascontiguousarray(block.accel[:]),
        np.ascontiguousarray(block.gyro[:]),
        np.ascontiguousarray(block.nodes, dtype=np.int64),
        np.ascontiguousarray(block.z),
    )
    ins.run(x, cov, samples, setup.rot_bs, setup.noise, rows, states, stds)
    return State(x, cov.reshape(ERRORS, ERRORS))


def step(state: State, sample: Sample, setup: Setup) -> State:
    """Fold one sample into the state: a block of one."""
    nodes = np.zeros(0 if sample.z is None else 1, dtype=np.int64)
    z = np.empty((0, MEASUREMENTS)) if sample.z is None else sample.z[None, :]
    block = Block(np.array([sample.time]), sample.accel[None, :], sample.gyro[None, :], nodes, z)
    return run(state, block, setup)[0]


def run_smoothed(state: State, block: Block, setup: Setup) -> tuple[State, Nodes]:
    """Fold a block, then go backward over its nodes.

    The states of the nodes are smoothed, the standard deviation of the grade and the state at the
    end are those of the forward pass. One stretch after another is run again from where it began:
    the covariances of a whole drive would fill the memory.
    """
    count = block.nodes.size
    edges = [*range(0, count, _STRETCH), count]
    cuts = [0, *(int(block.nodes[k - 1]) + 1 for k in edges[1:-1]), block.time.size]
    stretches = list(zip(pairwise(cuts), pairwise(edges), strict=True))
    states, grade_std = np.empty((count, SHOWN)), np.empty(count)
    stds = np.empty((_STRETCH, STDS))
    begins = []
    for cut, (first, last) in stretches:
        begins.append(state)
        part = block.part(*cut)
        state = _fold(state, part, setup, new_rows(), states[first:last], stds)
        grade_std[first:last] = stds[: last - first, S_GRADE]
    log, adjoint = new_rows(_STRETCH), np.zeros(ERRORS)
    for begin, (cut, (first, last)) in zip(reversed(begins), reversed(stretches), strict=True):
        part = block.part(*cut)
        _fold(begin, part, setup, log, states[first:last], stds)
        smooth(log, last - first, adjoint, states, first)
    return state, Nodes(block.time[block.nodes], states, grade_std)


def motion_at(state: State, setup: Setup) -> MotionRow:
    """Return how the vehicle moves at the last sample, by this and the samples before it."""
    x, cov = state
    rot = np.empty((3, 3))
    quaternion_to_matrix(x[Q : Q + 4], rot)
    roll, pitch, heading = matrix_to_euler(rot)
    velocity = x[V : V + 3]
    ahead = float(velocity @ rot[:, 0])
    accel = float(x[ACCEL])
    grade = pitch - float(x[PITCH0]) - (float(x[SQUAT]) if setup.use_squat else 0.0) * accel
    stds = np.empty((1, STDS))
    ins.deviations(x, np.ascontiguousarray(cov).ravel(), stds, 0)
    return MotionRow(
        time=state.time,
        speed=math.copysign(float(np.linalg.norm(velocity)), ahead),
        accel=accel,
        specific_force=accel + GRAVITY * math.sin(grade),
        grade=grade,
        pitch=pitch,
        roll=roll,
        heading=heading % (2.0 * math.pi),
        yaw_rate=float(x[RATE + 2]),
        speed_std=float(stds[0, S_SPEED]),
        grade_std=float(stds[0, S_GRADE]),
        heading_std=float(stds[0, S_HEADING]),
    )
