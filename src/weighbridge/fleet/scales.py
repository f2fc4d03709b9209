"""Errors of scale of a fleet's vehicles, found without tickets.

An error of the torque's scale acts on all masses of a vehicle alike. Its logarithm is ``x``, and
``u = x / s`` by the standard deviation s that the vehicle file states. Three things show it:

- Empty runs: the lightest cluster of a vehicle's masses. Nothing is assumed of the other loads but
  that few are above the permitted mass.
- The registered empty mass. As a rule it differs from the real one by driver and fuel. Some
  vehicles always carry something, or their registered mass is wrong. Of others the lightest
  cluster is any load.
- Vehicles of one type. ``u ~ N(sqrt(1 - r^2) m, r^2)``, where ``m ~ N(0, 1)`` is common to the
  type, and r is found from the fleet. So each vehicle by itself is as uncertain as its file says.

Everything is on grids: sums replace the integrals (Gelman et al., Bayesian Data Analysis, 3rd ed.,
2014, ch. 5).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from scipy.special import expit, logsumexp, ndtr

from weighbridge.messages import Problem
from weighbridge.signals import Floats

GRID: Final = np.linspace(-4.0, 4.0, 161)
"""Values of u and of m [-]: four standard deviations, in twentieths of one."""

OWN_SHARES: Final = np.geomspace(0.1, 1.0, 7)
"""Values of r, equally likely [-]: from vehicles that are nearly alike to no type at all, evenly by
their logarithm, as a scale is."""

NEVER: Final = 0.2
"""Vehicles whose lightest cluster is not of empty runs, before their drives are seen [-]. An
assumption; 0.1 and 0.3 change the RMS error of the study's fleets for tuning by 0.01 %."""

WRONG: Final = 0.1
"""Vehicles that carry something always, or whose registered mass is wrong, before their drives are
seen [-]. An assumption; 0.05 and 0.2 change the RMS error of the study's fleets for tuning by
0.02 %."""

WRONG_STD: Final = 0.08
"""Empty mass of such a vehicle over the registered one, standard deviation of its logarithm [-]. An
assumption: a loading crane of 1.5 t on a truck of 10 t is two of them; 0.05 and 0.12 change the RMS
error of the study's fleets for tuning by less than 0.01 %."""

OVER: Final = 0.1
"""Part of the loads that may be above the permitted mass [-]. An assumption; 0.05 and 0.2 change
the RMS error of the study's fleets for tuning from 2.00 to 2.12 and 1.97 %."""

HABITUAL: Final = 0.1
"""Operators that overload more of their drives [-]. An assumption; 0.02 and 0.3 change
the RMS error of the study's fleets for tuning by 0.03 %."""

FEWEST: Final = 0.04
"""Part of a vehicle's masses that a cluster has at least [-]: fewer may be faults of sensors."""

STRAY: Final = 0.02 / np.log(4.0)
"""Density of a ticket or a lightest cluster that fits nothing: one in fifty, evenly from half to
twice the mass by its logarithm, as ticket or file are of another vehicle [-]. An assumption."""

UNLIKELY: Final = -500.0
"""Least logarithm of a likelihood over the highest [-]: doubles end at -708, and a few hundred
tickets go beyond."""

LEAST_STD: Final = 0.003
"""No drive or ticket is more exact than this [-]: weighbridges of 60 t show steps of 20 kg, half of
one in 3500 kg."""

UNEQUAL_STD: Final = 0.008
"""Errors of empty and loaded runs of a vehicle differ by so much beside those of the drives,
standard deviation [-]: from 9 vehicles of ``weighbridge simulate fleet --seed 450101``."""


class Weighed(NamedTuple):
    """Drives of one vehicle.

    Attributes
    ----------
    vehicle : its id
    type : what vehicles that share an error have in common
    mass, own : (n,) weighed masses [kg], and their standard deviations without what all share [-]
    known : (n,) masses of tickets [kg]; NaN without one
    shared : standard deviation of the error of scale, as its file states [-]
    tare, gross : registered empty and permitted mass [kg]; NaN where not known
    emptied : what may be missing of the empty vehicle [kg]
    """

    vehicle: str
    type: str
    mass: Floats
    own: Floats
    known: Floats
    shared: float
    tare: float
    gross: float
    emptied: float


class Scale(NamedTuple):
    """What is known of one vehicle's scale.

    Attributes
    ----------
    vehicle, type : as of `Weighed`
    factor : true over weighed mass [-]
    std : its standard deviation [-]
    common_std : part of it that the vehicles of its type share [-]
    legs : drives that were used
    reason : why it is so
    """

    vehicle: str
    type: str
    factor: float
    std: float
    common_std: float
    legs: int
    reason: Problem


def find_scales(fleet: Sequence[Weighed]) -> list[Scale]:
    """Find the scales of a fleet, whatever the order of vehicles and drives.

    Parameters
    ----------
    fleet : vehicles, with at least one drive each

    Returns
    -------
    list of Scale
        In the order of their ids.
    """
    types: dict[str, list[Weighed]] = {}
    for one in sorted(fleet, key=lambda v: v.vehicle):
        types.setdefault(one.type, []).append(one)
    found = [scale for own in types.values() for scale in _of_type(own)]
    return sorted(found, key=lambda scale: scale.vehicle)


def _of_type(vehicles: Sequence[Weighed]) -> list[Scale]:
    """Find the scales of the vehicles of one type."""
    likely = np.array([_likelihoods(one) for one in vehicles])  # (n, 3, u)
    total = likely.sum(axis=1)
    mean = np.sqrt(1.0 - OWN_SHARES[:, None] ** 2) * GRID
    off = (GRID - mean[:, :, None]) / OWN_SHARES[:, None, None]
    of_type = np.exp(-0.5 * off**2)  # (r, m, u)
    of_type = (of_type / of_type.sum(axis=2, keepdims=True)).reshape(-1, GRID.size)
    each = of_type @ total.T  # (r m, n)
    before = np.tile(-0.5 * GRID**2, OWN_SHARES.size)
    weight = before + np.log(each).sum(axis=1)
    weight = np.exp(weight - logsumexp(weight))
    found = []
    means = of_type @ (total * GRID).T / each
    for k, one in enumerate(vehicles):
        rest = (weight / each[:, k]) @ of_type  # by the others, (u,)
        state = likely[k] @ rest
        state = state / state.sum()
        belief = rest * total[k]
        belief /= belief.sum()
        centre = float(belief @ GRID)
        spread = float(belief @ (GRID - centre) ** 2)
        common = float(weight @ (means[:, k] - centre) ** 2)
        found.append(_scale(one, centre, spread, common, state, len(vehicles)))
    return found


def _likelihoods(one: Weighed) -> Floats:
    """Likelihood of a vehicle's drives by u, for three states (3, u).

    The lightest cluster is empty runs at the registered mass, empty runs of another mass, or no
    empty runs.
    """
    x = one.shared * GRID
    known = np.isfinite(one.known)
    wide = np.maximum(one.own, LEAST_STD)
    off = np.log(one.mass[known] / one.known[known]) - x[:, None]
    by_ticket = np.log(_normal(off, wide[known]) + STRAY).sum(axis=1)
    # So unlikely is out of the question, and still a number that can be divided by.
    by_ticket = np.exp(np.maximum(by_ticket - by_ticket.max(), UNLIKELY))
    if not np.isfinite(one.tare) or not one.gross > one.tare:
        return np.stack([0.0 * by_ticket, 0.0 * by_ticket, by_ticket])
    tare, room = _tare_std(one), float(np.log(one.gross / one.tare))
    y = np.log(one.mass / one.tare)
    cluster = lightest(y, float(np.hypot(np.median(wide), tare)))
    over = cluster.place - x
    usual = _normal(over, float(np.hypot(tare, cluster.std)))
    wrong = _normal(over, float(np.hypot(WRONG_STD, cluster.std)))
    never = (ndtr(over / cluster.std) - ndtr((over - room) / cluster.std)) / room + STRAY
    empty = cluster.probability * (1.0 - NEVER)
    states = (empty * (1.0 - WRONG) * usual, empty * WRONG * wrong, (1.0 - empty) * never)
    # Few loads are above the permitted mass.
    top = float(np.quantile(y, 1.0 - OVER)) - room - x
    legal = HABITUAL + (1.0 - HABITUAL) * ndtr(-top / float(np.median(wide)))
    return np.asarray(np.stack(states) * by_ticket * legal)


class Cluster(NamedTuple):
    """The lightest cluster of a vehicle's masses.

    Attributes
    ----------
    place, std : its mean and the standard deviation of that, of the logarithm of mass
    probability : that it is one, and no accident of evenly spread masses
    """

    place: float
    std: float
    probability: float


def lightest(y: Floats, width: float) -> Cluster:
    """Find the lightest cluster: from below, the first place that its neighbours average to.

    Parameters
    ----------
    y : (n,) logarithms of mass, at least one
    width : standard deviation of those of empty runs

    Returns
    -------
    Cluster
        Its probability is by the likelihood ratio of two Poisson rates, inside and above, with as
        many places as the width allows (Kulldorff, Comm. Stat. Theory Methods 26, 1997, 1481).
    """
    y = np.sort(y)
    least = max(min(2, y.size), int(np.ceil(FEWEST * y.size)))
    for start in y:
        place = start
        for _ in range(y.size):
            inside = np.abs(y - place) <= 2.0 * width
            moved = float(y[inside].mean())
            if moved == place:
                break
            place = moved
        if np.count_nonzero(inside) >= least:
            break
    count = int(np.count_nonzero(inside))
    above = y[y > place + 2.0 * width]
    places = max(1.0, float(y[-1] - place) / (4.0 * width))
    expected = max(above.size, 1.0) / places
    gain = count * np.log(count / expected) - (count - expected) if count > expected else 0.0
    return Cluster(place, width / np.sqrt(count), float(expit(gain - np.log(places))))


def _normal(off: Floats, std: Floats | float) -> Floats:
    return np.asarray(np.exp(-0.5 * (off / std) ** 2) / (np.sqrt(2.0 * np.pi) * std))


def _tare_std(one: Weighed) -> float:
    """Standard deviation of the real empty mass: driver and fuel are there, or not [-]."""
    return float(one.emptied / np.sqrt(12.0) / one.tare)


def _scale(
    one: Weighed, centre: float, spread: float, common: float, state: Floats, alike: int
) -> Scale:
    """Return the scale of a vehicle from mean and variance of its u."""
    usual, wrong, never = state
    # What all registered masses leave out, such as the driver, no number of vehicles shows.
    tare = _tare_std(one) / 2.0 if np.isfinite(one.tare) else 0.0
    std = min(one.shared, float(np.sqrt(one.shared**2 * spread + tare**2 + UNEQUAL_STD**2)))
    together = min(std, float(np.hypot(one.shared * np.sqrt(common), tare)))
    shift = one.shared * centre
    tickets = int(np.isfinite(one.known).sum())
    values: dict[str, Any] = {
        "percent": 100.0 * np.expm1(shift),
        "std": 100.0 * std,
        "legs": int(np.isfinite(one.mass).sum()),
        "tickets": tickets,
        "alike": alike - 1,
    }
    if not np.isfinite(one.tare):
        reason = "fleet.scale_no_tare"
    elif usual >= max(wrong, never):
        reason = "fleet.scale_empty"
    elif wrong > never:
        reason = "fleet.scale_wrong"
    else:
        reason = "fleet.scale_never"
    return Scale(
        vehicle=one.vehicle,
        type=one.type,
        factor=float(np.exp(-shift)),
        std=std,
        common_std=together,
        legs=values["legs"],
        reason=Problem.of(reason, **values),
    )
