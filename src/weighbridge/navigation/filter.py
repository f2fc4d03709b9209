"""The navigation filter as a fold: state and samples in, state out."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from weighbridge.kernels import ins
from weighbridge.kernels.ins_model import (
    ERRORS,
    ROWS,
    SHOWN,
    Rows,
    Samples,
    new_rows,
)
from weighbridge.kernels.ins_smoother import smooth
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
        return self.stretch((first, last), (int(low), int(high)))

    def stretch(self, samples: tuple[int, int], nodes: tuple[int, int]) -> Block:
        """Return a run of samples with its nodes, both from the first up to the last (excluded)."""
        there, own = slice(*samples), slice(*nodes)
        return Block(
            self.time[there],
            self.accel[there],
            self.gyro[there],
            self.nodes[own] - samples[0],
            self.z[own],
        )


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


def run(state: State, block: Block, setup: Setup) -> tuple[State, Nodes]:
    """Fold a block of samples into the state; any split of the samples gives the same bits.

    Samples that are not finite or not later than the last one are left out; over more than
    0.5 s without samples the state is carried with the uncertainty a vehicle can make.
    """
    count = block.nodes.size
    states, grade_std = np.empty((count, SHOWN)), np.empty(count)
    state = _fold(state, block, setup, new_rows(), states, grade_std)
    return state, Nodes(block.time[block.nodes], states, grade_std)


def _fold(
    state: State, block: Block, setup: Setup, rows: Rows, states: Floats, grade_std: Floats
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
    ins.run(x, cov, samples, setup.rot_bs, setup.noise, rows, states, grade_std)
    return State(x, cov.reshape(ERRORS, ERRORS))


def misfit(state: State, block: Block, setup: Setup) -> float:
    """Return minus twice the log-likelihood of the measurements of a block, but for a constant.

    A row beyond the gate is not refused, but counts as one at the gate that is less sure: a
    refused row would cost nothing.
    """
    count = block.nodes.size
    rows = new_rows(max(count, 2))
    open_gate = replace(setup, noise=setup.noise._replace(patience=0.0))
    _fold(state, block, open_gate, rows, np.empty((count, SHOWN)), np.empty(count))
    used = np.arange(ROWS) < rows.row_count[:, None]
    innovation, var = rows.innovation[used], rows.innovation_var[used]
    return float(np.sum(innovation**2 / var + np.log(var)))


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
    again = np.empty(_STRETCH)
    begins = []
    for cut, (first, last) in stretches:
        begins.append(state)
        part = block.stretch(cut, (first, last))
        state = _fold(state, part, setup, new_rows(), states[first:last], grade_std[first:last])
    log, adjoint = new_rows(_STRETCH), np.zeros(ERRORS)
    for begin, (cut, (first, last)) in zip(reversed(begins), reversed(stretches), strict=True):
        part = block.stretch(cut, (first, last))
        _fold(begin, part, setup, log, states[first:last], again)
        smooth(log, last - first, adjoint, states, first)
    return state, Nodes(block.time[block.nodes], states, grade_std)
