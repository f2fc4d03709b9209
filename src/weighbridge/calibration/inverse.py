"""Torque model and road load as the joint estimator needs them.

The reading of the torque source stands alone on the left, because the fast
noise is in it; disturbances stand beside the parameters; and both sides are
averaged over the same windows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np
from scipy.linalg import block_diag

from weighbridge.balance import WINDOW, Windows, law, windows
from weighbridge.balance.table import ForceTable
from weighbridge.errors import DriveError
from weighbridge.estimators.joint import JointSettings
from weighbridge.estimators.joint.slow_errors import noise_variance
from weighbridge.estimators.joint.terms import COLD_LASTS, Sizes, Term, terms_of
from weighbridge.estimators.noisy_motion import too_low
from weighbridge.kernels import disturbance as kernel
from weighbridge.navigation import Motion
from weighbridge.signals import Bools, Floats
from weighbridge.vehicle import TorqueSource, TorqueTerms, Vehicle


class TooShort(DriveError):
    """The drives have too few usable windows for the fit."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveRows:
    """What one drive of known mass gives to the fit, one row per usable sample.

    Attributes
    ----------
    table : force table of the drive
    regressor : load [-] or torque [N m]
    engine_speed : [rad/s]
    usable : rows to take
    mass : known, as the drive begins [kg]
    motion : of the drive
    beside : (n,) force that the torque gives beside the wheels, shown by another fit [N]
    motion_noise : variance of the noise in the mean specific force of a window [m^2/s^4]
    """

    table: ForceTable
    regressor: Floats
    engine_speed: Floats
    usable: Bools
    mass: float
    motion: Motion
    beside: Floats | float = 0.0
    motion_noise: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class InverseFit:
    """Result of the fit.

    Attributes
    ----------
    coefficients : (p,) w0, w1, w2 ... of Jensen 2022, eq. 49, then the curvature and the
        slopes at the knots
    road : (4,) C_d A, C_r, I_e, I_w
    stds : (p + 4,) standard deviations of both
    cov : (p + 4, p + 4) covariance of both
    log_likelihood : of the innovations
    windows : number of windows
    """

    coefficients: Floats
    road: Floats
    stds: Floats
    cov: Floats
    log_likelihood: float
    windows: int


AROUND: Final = 60.0
"""Pressures are averaged over so long before and after [s]."""

BESIDE: Final = (
    "disturbance", "resistance", "wind_north", "wind_east", "cold_torque", "ratio_lateness",
)  # fmt: skip
"""Terms that another drive has another state of."""

TYPICAL_SPEED: Final = 300.0
"""Engine speed at which the growth of torque terms is given [rad/s]."""

KNOT_LENGTH: Final = 0.35
"""Length over which the full-load curve of an engine bends, in the logarithm of its speed [-]."""

KNOT_RATIO: Final = 1.25
"""Ratio of neighbouring knots [-]."""


def knots_between(slow: float, fast: float) -> tuple[float, ...]:
    """Return knots from ``slow`` to ``fast``, evenly apart in the logarithm [rad/s]."""
    count = max(2, 1 + round(np.log(fast / slow) / np.log(KNOT_RATIO)))
    return tuple(float(k) for k in np.geomspace(slow, fast, count))


@dataclass(frozen=True, slots=True, kw_only=True)
class FitSettings:
    """What is fitted, and what is known before.

    Attributes
    ----------
    source : of the torque
    order : highest power of engine speed
    curved : let torque per load bend with engine speed and load
    knots : engine speeds of a smooth correction of torque per reading [rad/s]
    bounds : what is known of the terms before
    torque_noise : of one reading, as torque [N m]
    vehicle : its driveline, and its road load as if that were known
    prior : mean and standard deviation (4,) of C_d A, C_r, I_e, I_w
    lasting_drag : learn the drag area from the lasting part of the pressure alone; what comes and
        goes within `AROUND` is taken with that of the class
    window : length of the windows [s]
    rounds : of refining the fitted reading
    """

    source: TorqueSource
    order: int
    curved: bool
    knots: tuple[float, ...]
    bounds: TorqueTerms
    torque_noise: float
    vehicle: Vehicle
    prior: tuple[Floats, Floats]
    lasting_drag: bool = False
    window: float = WINDOW
    rounds: int = 3

    @property
    def beside(self) -> tuple[Term, ...]:
        """Terms that stand beside what is fitted, with a state of each drive."""
        return terms_of(self.vehicle, BESIDE)


def terms_covariance(
    terms: TorqueTerms, settings: FitSettings, torque: float, reading: float
) -> Floats:
    """Covariance of the terms beside the reading, in the order of `torque_rows`.

    Parameters
    ----------
    terms : standard deviations before any drive
    settings : which terms there are
    torque, reading : highest of the drives [N m], [unit of the reading]

    References
    ----------
    The correction is a Gaussian process over the logarithm of engine speed: Rasmussen and
    Williams, Gaussian Processes for Machine Learning, 2006, ch. 4.
    """
    stds = [terms.offset]
    stds += [terms.growth / TYPICAL_SPEED**k for k in range(1, settings.order + 1)]
    if settings.curved:
        stds += [terms.speed_growth / (TYPICAL_SPEED * reading), terms.bend / reading**2]
    cov = np.diag(np.square(stds))
    if settings.knots:
        where = np.log(settings.knots)
        apart = (where[:, None] - where) / KNOT_LENGTH
        knot_cov = (terms.knot / reading) ** 2 * np.exp(-0.5 * apart**2)
        cov = block_diag(cov, knot_cov)
    return np.asarray(torque**2 * cov)


def lasting_pressure(table: ForceTable) -> Floats:
    """Mean dynamic pressure within `AROUND` of each row (n,) [Pa]."""
    known = np.isfinite(table.dynamic_pressure)
    total = np.concatenate(([0.0], np.cumsum(np.where(known, table.dynamic_pressure, 0.0))))
    count = np.concatenate(([0], np.cumsum(known)))
    first = np.searchsorted(table.time, table.time - AROUND)
    last = np.searchsorted(table.time, table.time + AROUND, side="right")
    return np.asarray((total[last] - total[first]) / np.maximum(count[last] - count[first], 1))


def fit_with_gusts(drives: list[DriveRows], settings: FitSettings) -> InverseFit:
    """Fit as `fit` does, and keep open what gusts leave confounded.

    A vehicle that meets a gust slows down. So where drag is high speed is low, the more the less
    power there is in hand: the drag area comes out small, and offset and rolling resistance
    large for it. How fast a road is driven at all depends on no gust, but says less. Where both
    ways to learn the drag area differ, the covariance holds their difference.

    Parameters and errors are those of `fit`.

    References
    ----------
    Regressors that answer to the disturbance: Greene, Econometric Analysis, 2018, ch. 8.
    """
    plain = fit(drives, settings)
    other = fit(drives, replace(settings, lasting_drag=True))
    apart = np.concatenate((other.coefficients - plain.coefficients, other.road - plain.road))
    mean, std = settings.prior
    return _confounded(plain, apart, float(mean[0]), float(std[0]))


def _confounded(plain: InverseFit, apart: Floats, mean: float, std: float) -> InverseFit:
    """Add what gusts leave confounded to a fit, and let the prior drag area count against it.

    The prior has been weighed against the noise alone. A drag area that gusts draw below
    zero meets it again: the likelihood is taken out of the posterior, widened,
    and met with the prior. The other parameters follow by their covariance with the drag area,
    which stays at zero or above.

    Parameters
    ----------
    plain : fit to be completed
    apart : (p + 4,) what the other fit finds more
    mean, std : of the drag area before any drive [m^2]
    """
    drag = plain.coefficients.size
    cov = plain.cov + np.outer(apart, apart)
    x = np.concatenate((plain.coefficients, plain.road))
    var, before = float(plain.cov[drag, drag]), std**2
    if x[drag] > 0.0 or not 0.0 < var < before:
        return replace(plain, cov=cov, stds=np.sqrt(np.maximum(np.diag(cov), 0.0)))
    alone = 1.0 / (1.0 / var - 1.0 / before)
    by_drives = alone * (float(x[drag]) / var - mean / before)
    widened = alone + (float(apart[drag]) * alone / var) ** 2
    after = 1.0 / (1.0 / before + 1.0 / widened)
    wanted = max(after * (mean / before + by_drives / widened), 0.0)
    gain = cov[:, drag] / cov[drag, drag]
    x = x + gain * (wanted - x[drag])
    cov = cov - np.outer(gain, gain) * (cov[drag, drag] - after)
    return replace(
        plain,
        coefficients=x[:drag],
        road=x[drag:],
        cov=cov,
        stds=np.sqrt(np.maximum(np.diag(cov), 0.0)),
    )


def fit(drives: list[DriveRows], settings: FitSettings) -> InverseFit:
    """Fit the reading of the torque source to the force that the motion takes.

    With the fast noise on the side of the torque source, its reading is what
    is regressed: ``w1 G L = m f + C_d A q + ... - G (w0 + w2 N + ...)`` is
    divided by w1, which keeps the problem linear. The curvature needs the
    reading on the right as well; there the fitted one of the round before
    is in its place, so that no noise enters. It is centred: a curve whose
    mean is not zero would explain the reading by itself.

    Parameters
    ----------
    drives : rows of each drive
    settings

    Raises
    ------
    TooShort
        Too few usable windows.
    """
    cuts, total = _cut(drives, settings)
    scale = _torque_per_reading(drives)
    centre = _centre(drives, settings)
    # The first round is straight: a reading on both sides would explain itself, and where the
    # motion is noisy the motion would explain nothing.
    readings = [np.zeros_like(d.regressor) for d in drives]
    for _ in range(settings.rounds):
        design = _design(drives, cuts, readings, (scale, centre), settings)
        state = _solve(design, [d.regressor for d in drives], scale, settings)
        readings = [
            _fitted(d, columns, state, scale, settings)
            for d, columns in zip(drives, design.columns, strict=True)
        ]
    return _unpack(state, scale, centre, total)


def log_likelihoods(
    drives: list[DriveRows], readings: Sequence[Sequence[Floats]], settings: FitSettings
) -> list[float]:
    """Log-likelihoods of a straight fit to each of several readings of the same rows.

    Parameters
    ----------
    drives : rows of each drive
    readings : (n,) of each drive, in place of its own
    settings
    """
    cuts, _ = _cut(drives, settings)
    none = [np.zeros_like(d.regressor) for d in drives]
    design = _design(drives, cuts, none, (1.0, np.zeros(_extra(settings))), settings)
    found = []
    for each in readings:
        read = [replace(d, regressor=reading) for d, reading in zip(drives, each, strict=True)]
        state = _solve(design, each, _torque_per_reading(read), settings)
        found.append(float(state.log_likelihood))
    return found


def _cut(drives: list[DriveRows], settings: FitSettings) -> tuple[list[Windows], int]:
    """Windows of the rows of each drive, and how many there are; refuse too few."""
    cuts = [windows(d.table.time, d.usable, length=settings.window) for d in drives]
    total = sum(cut.count.size for cut in cuts)
    p = 2 + settings.order + 2 * settings.curved
    if total < 15 * (p + 4) or any(cut.count.size == 0 for cut in cuts):
        raise TooShort(
            f"only {total} usable stretches of time for {p + 4} parameters; drive longer, with "
            "more starts and in all gears"
        )
    return cuts, total


def _extra(settings: FitSettings) -> int:
    """Torque terms beside the reading."""
    return 1 + settings.order + 2 * settings.curved + len(settings.knots)


def _centre(drives: list[DriveRows], settings: FitSettings) -> Floats:
    """Part of the reading that each torque term beside it takes on the mean of the drives (k,).

    0 of those that do not depend on the reading.
    """
    square, common = 0.0, np.zeros(_extra(settings))
    for d in drives:
        gearing = np.nan_to_num(d.table.gearing)[d.usable]
        terms = _terms(d, d.regressor, settings)[d.usable]
        read = gearing * d.regressor[d.usable]
        square += float(read @ read)
        common += read @ np.delete(terms, 1, axis=1)
    common[: 1 + settings.order] = 0.0
    return common / square


def _terms(d: DriveRows, reading: Floats, settings: FitSettings) -> Floats:
    """Force of one unit of each torque term at a reading (n, p)."""
    return law.reading_columns(
        np.nan_to_num(d.table.gearing), reading, d.engine_speed,
        order=settings.order, curved=settings.curved, knots=settings.knots,
    )  # fmt: skip


def _torque_per_reading(drives: list[DriveRows]) -> float:
    """Rough torque per unit of reading, to make the first coefficient about one [N m]."""
    slopes = []
    for d in drives:
        rows = d.usable
        target = d.mass * d.table.specific_force[rows] / d.table.gearing[rows]
        reading = d.regressor[rows]
        centred = reading - reading.mean()
        if not float(centred @ centred) > 0.0:
            raise TooShort("torque or load never changes in the usable rows; record it again")
        slopes.append(float(centred @ target) / float(centred @ centred))
    return float(np.median(slopes))


def _columns(
    d: DriveRows, reading: Floats, taken: tuple[float, Floats], settings: FitSettings
) -> Floats:
    """Columns of one drive: motion, road load, torque terms, and what stands beside them.

    Parameters
    ----------
    d : the drive
    reading : fitted (n,), for columns that need it
    taken : rough torque per reading, and `_centre`
    settings
    """
    scale, centre = taken
    table = replace(d.table, traction_force=scale * d.table.gearing * reading)
    mass = d.mass - table.fuel_burnt
    pushed = mass * table.specific_force + d.beside
    road = law.road_columns(table, mass, settings.vehicle.driveline.wheel_radius)
    if settings.lasting_drag:
        lasting = lasting_pressure(table)
        pushed = pushed + settings.prior[0][0] * (law.drag_column(table) - lasting)
        road[:, 0] = lasting
    terms = _terms(d, reading, settings)
    beside = np.delete(terms, 1, axis=1) - np.outer(terms[:, 1], centre)
    columns = [
        pushed,
        *road.T,
        # The reading itself stands on the left; the other torque terms stand here.
        *-beside.T,
        *(
            term.column(table, settings.vehicle, d.motion.unmeasured_grade)
            for term in settings.beside
        ),
    ]
    return np.asarray(np.nan_to_num(np.column_stack(columns)))


class _Design(NamedTuple):
    """What a fit reads of all drives, one after another, beside the reading of the source.

    Attributes
    ----------
    time : (m,) of the windows; between two drives every disturbance fades [s]
    rows : (m, k) of the states
    variance : (m,) of the noise [N^2]
    cuts : windows of each drive
    gearings : (n,) of each drive, by sample [1/m]
    columns : (n, k) of each drive, by sample
    mass : mean of the drives [kg]
    noise : variance of the noise of the first column, in the mean of the windows [N^2]
    grade : what no sensor measures of it, in the drive that leaves most [rad]
    """

    time: Floats
    rows: Floats
    variance: Floats
    cuts: list[Windows]
    gearings: list[Floats]
    columns: list[Floats]
    mass: float
    noise: float
    grade: float


def _design(
    drives: list[DriveRows],
    cuts: list[Windows],
    readings: list[Floats],
    taken: tuple[float, Floats],
    settings: FitSettings,
) -> _Design:
    """Average the columns of all drives over their windows."""
    mass = float(np.mean([d.mass for d in drives]))
    gearings = [np.nan_to_num(d.table.gearing) for d in drives]
    columns = [_columns(d, each, taken, settings) for d, each in zip(drives, readings, strict=True)]
    times, variances = [], []
    clock = 0.0
    for d, cut, gearing in zip(drives, cuts, gearings, strict=True):
        time = cut.mean(d.table.time)
        times.append(time - time[0] + clock)
        clock = float(times[-1][-1]) + 1e5
        noisy = replace(d.table, force_std=settings.torque_noise * gearing)
        variances.append(noise_variance(noisy, cut, mass, d.motion, settings.window))
    rows = [cut.mean(each) for cut, each in zip(cuts, columns, strict=True)]
    return _Design(
        time=np.concatenate(times),
        rows=np.ascontiguousarray(np.vstack(rows)),
        variance=np.concatenate(variances),
        cuts=cuts,
        gearings=gearings,
        columns=columns,
        mass=mass,
        noise=float(
            np.average(
                [d.mass**2 * d.motion_noise for d in drives],
                weights=[cut.count.size for cut in cuts],
            )
        ),
        grade=max(d.motion.unmeasured_grade for d in drives),
    )


def _solve(
    design: _Design,
    readings: Sequence[Floats],
    scale: float,
    settings: FitSettings,
) -> kernel.DisturbanceState:
    """Run the filter over all drives one after another."""
    mean, std = settings.prior
    extra = _extra(settings)
    parts = list(zip(design.cuts, design.gearings, readings, strict=True))
    reached = np.concatenate([cut.mean(scale * g * np.nan_to_num(each)) for cut, g, each in parts])
    gearing = np.concatenate([cut.mean(g) for cut, g, _ in parts])
    torque = float(np.percentile(reached / np.maximum(gearing, 1e-3), 98.0))
    terms = terms_covariance(settings.bounds, settings, torque, torque / scale)
    sizes = Sizes(design.mass, torque, design.grade)
    fading = np.array([term.std(settings.vehicle, sizes) for term in settings.beside])
    # What is constant over a drive is another in the next.
    fades = [min(term.time_constant, COLD_LASTS) for term in settings.beside]
    x0 = np.concatenate(([1.0], mean, np.zeros(extra), np.zeros(fading.size)))
    prior = block_diag(np.diag(np.square([0.5, *std])), terms, np.diag(np.square(fading)))
    params = kernel.DisturbanceParams(
        time_constant=np.concatenate((np.full(5 + extra, np.inf), fades)),
        std=np.concatenate((np.zeros(5 + extra), fading)),
        gate=JointSettings().gate,
        settle_rows=100,
    )
    start = kernel.initial_state(x0, prior, 0.0)  # type: ignore[no-untyped-call]
    state, _, _, _, _ = kernel.run(
        start, design.time, design.rows, reached,
        design.variance, np.zeros(design.rows.shape), params,
    )  # fmt: skip
    if design.noise == 0.0:
        return state  # type: ignore[no-any-return]
    weights = kernel.weights(
        start, design.time, design.rows, reached,
        design.variance, np.zeros(design.rows.shape), params,
    )  # fmt: skip
    return without_noise(state, design.noise * weights)


def without_noise(state: kernel.DisturbanceState, information: float) -> kernel.DisturbanceState:
    """Take the noise of the first regressor out of what the rows show.

    Least squares takes the square of a noisy regressor for information: slopes over it come out
    too small, and what goes along with it takes their place.

    Parameters
    ----------
    state : after all rows
    information : the trace of their weights times the variance of that noise

    References
    ----------
    Fuller, Measurement Error Models, 1987, ch. 2.2.
    """
    gain = state.cov[:, 0]
    missing = float(too_low(information * gain[0])) / gain[0]
    return state._replace(
        x=state.x + gain * missing * state.x[0], cov=state.cov + missing * np.outer(gain, gain)
    )


def _fitted(
    d: DriveRows,
    columns: Floats,
    state: kernel.DisturbanceState,
    scale: float,
    settings: FitSettings,
) -> Floats:
    """Reading that the state makes of the columns of a drive (n,)."""
    gearing = np.nan_to_num(d.table.gearing)
    known = 5 + _extra(settings)
    predicted = columns[:, :known] @ state.x[:known]
    return np.where(gearing > 0.0, predicted / (scale * np.maximum(gearing, 1e-3)), d.regressor)


def _unpack(state: kernel.DisturbanceState, scale: float, centre: Floats, total: int) -> InverseFit:
    """Divide by the first coefficient, and carry the covariance along."""
    extra = centre.size
    x, cov = state.x[: 5 + extra], state.cov[: 5 + extra, : 5 + extra]
    ratio = x[1:] / x[0]
    # Rows: w0, w1, w2 ... with the curvature, then the road. d(a / x0) = (da - a / x0 dx0) / x0.
    slopes = np.zeros((5 + extra, 5 + extra))
    slopes[0, 5], slopes[0, 0] = 1.0, -ratio[4]
    slope = (scale - float(centre @ x[5:])) / x[0]
    slopes[1, 0], slopes[1, 5:] = -slope, -centre
    for row, column in enumerate([*range(6, 5 + extra), *range(1, 5)], start=2):
        slopes[row, column], slopes[row, 0] = 1.0, -ratio[column - 1]
    slopes /= x[0]
    cov = slopes @ cov @ slopes.T
    return InverseFit(
        coefficients=np.concatenate(([ratio[4]], [slope], ratio[5:])),
        road=ratio[:4],
        stds=np.sqrt(np.maximum(np.diag(cov), 0.0)),
        cov=cov,
        log_likelihood=float(state.log_likelihood),
        windows=total,
    )
