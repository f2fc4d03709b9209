"""Nodes of the filter and the measurements at them.

Each function looks at the whole drive or, where it says ``causal``, at most `AHEAD` seconds past
the node it works for.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from weighbridge.kernels.ins_model import (
    MEASUREMENTS,
    Z_D,
    Z_HVAR,
    Z_N,
    Z_PITCH_MOVED,
    Z_SPEED,
    Z_SPEED_VAR,
    Z_VE,
    Z_VEL_VAR,
    Z_VN,
    Z_VVAR,
    Z_YAW_MOVED,
)
from weighbridge.kernels.shaking import widest_spread
from weighbridge.navigation.aiding import Fixes, interpolated
from weighbridge.navigation.even import Even
from weighbridge.navigation.settings import NavigationSettings
from weighbridge.signals import Bools, Drive, Floats, Ints, Signal, resolution

AHEAD: Final = 0.3
"""A causal pass looks so far past an instant [s], delays of the sources taken off."""

_QUIET_HALF: Final = 0.5
"""A body rests if it does so around an instant [s],"""

_QUIET_AHEAD: Final = 0.1
"""in a causal pass up to so long after it: low-passing takes the rest of what it may see [s]."""

_HEIGHT_PERIOD, _HEIGHT_TIME = 10.0, 300.0
"""Without heights, distance of the pseudo-heights and how long hills last [s]."""

_NEAREST: Final = 0.1
"""A fix further from a node is left out [s]."""


@dataclass(frozen=True, slots=True)
class Clocks:
    """How late and how often the aiding signals come.

    Attributes
    ----------
    speed_delay, gnss_delay : stamp minus the instant a value was true [s]
    speed_period, fix_period, velocity_period : usual distance of samples of the speed, of the
        fixes and of the GNSS velocity [s]; NaN without
    row_period : of the rows that the speed makes: no node has more than one [s]
    speed_step : resolution of the speed [m/s]; 0 where none shows
    """

    speed_delay: float
    gnss_delay: float
    speed_period: float
    fix_period: float
    velocity_period: float
    row_period: float
    speed_step: float


def find_clocks(
    drive: Drive, speed: Signal | None, fixes: Fixes | None, delays: tuple[float, float],
    node_time: Floats,
) -> Clocks:  # fmt: skip
    """Gather delays, periods and resolution from a whole drive."""
    velocity = drive.get("gnss_speed")
    period = speed.period if speed is not None else np.nan
    return Clocks(
        *delays,
        speed_period=period,
        row_period=max(period, float(np.median(np.diff(node_time)))),
        fix_period=float(np.median(np.diff(fixes.time))) if fixes is not None else np.nan,
        velocity_period=velocity.period if velocity is not None else np.nan,
        speed_step=resolution(speed.values) if speed is not None else 0.0,
    )


def place_nodes(
    time: Floats, fixes: Floats, rate: float, max_gap: float, *, causal: bool = False
) -> Ints:
    """Choose the samples at which covariance and measurements are processed.

    An even ``rate``, and the sample nearest to each GNSS fix, so that no fix is
    used at another instant than its own; both sides of each gap. A causal pass knows of a gap
    only after it, of no end, and counts from 0 s.
    """
    slots = np.floor((time - (0.0 if causal else time[0])) * rate + 1e-6).astype(np.int64)
    even = np.flatnonzero(np.diff(slots, prepend=-1) > 0)
    right = np.clip(np.searchsorted(time, fixes), 1, time.size - 1)
    nearest = np.where(fixes - time[right - 1] < time[right] - fixes, right - 1, right)
    nearest = nearest[np.abs(time[nearest] - fixes) < _NEAREST]
    after = np.flatnonzero(np.diff(time) > max_gap)
    chosen = np.zeros(time.size, dtype=bool)
    for places in (even, nearest, after + 1):
        chosen[places] = True
    if not causal:
        chosen[after] = chosen[0] = chosen[-1] = True
    return np.flatnonzero(chosen)


def rests(grid: Even, rot_bs: Floats, limits: tuple[float, float], *, causal: bool) -> Bools:
    """Return the instants (n,) of an even clock around which force and rate hardly change.

    Parameters
    ----------
    grid : low-passed inertial samples in sensor axes
    rot_bs : (3, 3) sensor to body axes
    limits : standard deviations of specific force [m/s^2] and angular rate [rad/s]
    """
    period = float(grid.time[1] - grid.time[0])
    half = max(1, round(_QUIET_HALF / period))
    late = half - round(_QUIET_AHEAD / period) if causal else 0

    def spread(y: Floats) -> Floats:
        found: Floats = widest_spread(np.nan_to_num(y, nan=1e3), half)
        return found

    quiet: Bools = (spread(grid.values[:, :3] @ rot_bs.T) < limits[0]) & (
        spread(grid.values[:, 3:] @ rot_bs.T) < limits[1]
    )
    if late:
        quiet = np.concatenate([np.zeros(late, dtype=bool), quiet[:-late]])
    return quiet


def still_state(
    node_time: Floats, grid: Even, rot_bs: Floats, wheel: Signal | None, reference: Signal,
    *, causal: bool = False,
) -> Floats:  # fmt: skip
    """Distinguish standing from moving: 0 moving, 1 wheels stand, 2 the body rests too.

    Parameters
    ----------
    node_time : (m,) [s]
    grid : low-passed inertial samples in sensor axes
    rot_bs : (3, 3) sensor to body axes
    wheel : speed of the wheels without its delay, which shows standing as zero; None without
    reference : another speed without its delay
    """
    period = float(grid.time[1] - grid.time[0])
    index = np.clip(np.round((node_time - grid.time[0]) / period), 0, grid.time.size - 1)
    at = index.astype(np.int64)
    still = np.zeros(node_time.size)
    if wheel is None:
        fast = (
            _held(reference, grid.time, 3.0) if causal else interpolated(reference, grid.time, 3.0)
        )
        calm = rests(grid, rot_bs, (0.05, 0.004), causal=causal) & ~(fast > 0.7)
        still[calm[at]] = 2.0
        return still
    most = AHEAD if causal else np.inf
    moving = wheel.time[np.abs(wheel.values) >= 0.05]
    stands = _distance(moving, node_time, most) > max(0.4, 1.1 * wheel.period)
    stands &= _distance(wheel.time, node_time, most) < max(1.0, 1.5 * wheel.period)
    still[stands] = 1.0
    still[stands & rests(grid, rot_bs, (0.12, 0.008), causal=causal)[at]] = 2.0
    return still


def _distance(stamps: Floats, time: Floats, ahead: float) -> Floats:
    """Distance to the nearest stamp, of those after at most ``ahead`` away; infinite without."""
    right = np.searchsorted(stamps, time)
    padded = np.concatenate([[-np.inf], stamps, [np.inf]])
    after = padded[right + 1] - time
    return np.asarray(np.minimum(time - padded[right], np.where(after <= ahead, after, np.inf)))


def _held(signal: Signal, time: Floats, longest: float) -> Floats:
    """Last value of a signal; NaN where it is older than that."""
    if not len(signal):
        return np.full(time.size, np.nan)
    place = np.searchsorted(signal.time, time, side="right") - 1
    held = np.where(place >= 0, signal.values[np.maximum(place, 0)], np.nan)
    age = time - signal.time[np.maximum(place, 0)]
    return np.where(age <= longest, held, np.nan)


def measurements(
    node_time: Floats, drive: Drive, speed: Signal | None, fixes: Fixes | None, clocks: Clocks,
    settings: NavigationSettings, *, has_height: bool, causal: bool = False,
) -> Floats:  # fmt: skip
    """Lay all measurements out, one row (13,) per node, NaN where there is none.

    Parameters
    ----------
    node_time : (m,) [s]
    drive : for what the receiver says of its accuracy, and its velocity
    speed : without its delay; None without
    fixes : as recorded; None without
    clocks : delays and periods
    settings : noise levels
    has_height : the drive's fixes carry height
    """
    z = np.full((node_time.size, MEASUREMENTS), np.nan)
    if speed is not None and len(speed) > 1:
        _speed_rows(z, node_time, speed, clocks, settings, causal=causal)
    if fixes is not None:
        _fix_rows(z, node_time, drive, fixes, clocks, settings)
        _velocity_rows(z, node_time, drive, clocks, settings)
    if not has_height:
        # nobody drives far up or down for long: without heights this alone keeps
        # a bias of the accelerometer from being taken for an endless hill
        every = np.flatnonzero(np.diff(np.floor(node_time / _HEIGHT_PERIOD), prepend=-1.0) > 0)
        z[every, Z_D] = 0.0
        z[every, Z_VVAR] = settings.height_range**2 * _HEIGHT_TIME / _HEIGHT_PERIOD
    return z


def _speed_rows(
    z: Floats, node_time: Floats, speed: Signal, clocks: Clocks, settings: NavigationSettings,
    *, causal: bool,
) -> None:  # fmt: skip
    """Add one row per sample of the speed: interpolating makes no information.

    The row stands at the first node after the sample; in a causal pass, which does not know the
    next sample, at the last one before.
    """
    values = interpolated(speed, node_time, max(1.6, 3.0 * clocks.speed_period))
    seen = np.searchsorted(speed.time, node_time)
    ends = {"append": seen[-1]} if causal else {"prepend": seen[0] - 1}
    values[np.diff(seen, **ends) <= 0] = np.nan
    least = settings.speed_std**2 + clocks.speed_step**2 / 12.0
    var = least + (settings.speed_slip_std * values) ** 2
    z[:, Z_SPEED] = values
    z[:, Z_SPEED_VAR] = var * max(1.0, 2.0 * settings.constraint_time / clocks.row_period)


def _nearest(node_time: Floats, time: Floats) -> Ints:
    """Node nearest to each instant."""
    right = np.clip(np.searchsorted(node_time, time), 1, node_time.size - 1)
    return np.where(time - node_time[right - 1] < node_time[right] - time, right - 1, right)


def _fix_rows(
    z: Floats, node_time: Floats, drive: Drive, fixes: Fixes, clocks: Clocks,
    settings: NavigationSettings,
) -> None:  # fmt: skip
    """Add the fixes, with the accuracy the receiver gives."""
    time = fixes.time - clocks.gnss_delay
    node = _nearest(node_time, time)
    near = np.abs(node_time[node] - time) < _NEAREST
    node = node[near]
    z[node, Z_N : Z_D + 1] = fixes.ned[near]
    inflate = max(1.0, settings.gnss_time / clocks.fix_period)
    horizontal = np.full(node.size, settings.gnss_horizontal_std)
    accuracy, hdop = drive.get("gnss_accuracy"), drive.get("hdop")
    if accuracy is not None and len(accuracy):
        horizontal = np.clip(accuracy.held(fixes.time[near]), 1.0, 1e3)
    elif hdop is not None and len(hdop):
        horizontal = settings.gnss_horizontal_std * np.clip(hdop.held(fixes.time[near]), 1, 50)
    horizontal = np.where(np.isfinite(horizontal), horizontal, settings.gnss_horizontal_std)
    ratio = settings.gnss_vertical_std / settings.gnss_horizontal_std
    z[node, Z_HVAR] = horizontal**2 * inflate
    z[node, Z_VVAR] = (horizontal * ratio) ** 2 * inflate


def _velocity_rows(
    z: Floats, node_time: Floats, drive: Drive, clocks: Clocks, settings: NavigationSettings
) -> None:
    """Add velocity over ground where the receiver gives speed and course."""
    over_ground, course = drive.get("gnss_speed"), drive.get("gnss_course")
    if over_ground is None or course is None or len(over_ground) < 2 or len(course) < 2:
        return
    time = over_ground.time - clocks.gnss_delay
    good = (over_ground.values > 2.0) & (course.age(over_ground.time) < 0.05)
    node = _nearest(node_time, time)
    good &= np.abs(node_time[node] - time) < 0.05
    node = node[good]
    angle = course.values[
        np.clip(np.searchsorted(course.time, over_ground.time[good] - 0.05), 0, len(course) - 1)
    ]
    inflate = max(1.0, settings.gnss_time / clocks.velocity_period)
    z[node, Z_VN] = over_ground.values[good] * np.cos(angle)
    z[node, Z_VE] = over_ground.values[good] * np.sin(angle)
    # a course is worse the slower the vehicle: its error across grows as 1 degree of speed
    z[node, Z_VEL_VAR] = (
        settings.gnss_velocity_std**2 + (0.02 * over_ground.values[good]) ** 2
    ) * inflate


def open_mounting(z: Floats, node_time: Floats, at: Floats, variance: Floats) -> None:
    """Add variances (k, 2) of pitch and yaw of the mounting at the first node from each instant.

    The first node of all is left as it is.
    """
    node = np.searchsorted(node_time, at)
    inside = (node > 0) & (node < node_time.size)
    moved = np.zeros((node_time.size, 2))
    np.add.at(moved, node[inside], variance[inside])
    z[:, Z_PITCH_MOVED], z[:, Z_YAW_MOVED] = moved.T
