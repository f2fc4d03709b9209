"""Interacting multiple models in place of a blend (studies/du2025.md).

Both filters of `hybrid` run side by side. Each window of the least squares is foretold by both;
the likelihoods of these innovations give the probability of either model, which changes hands at
a small rate. With `mixing` each filter begins every window at the mixed mass, as the method has
it; without, the probabilities alone weigh two filters that know nothing of each other.

References
----------
Blom and Bar-Shalom, IEEE Transactions on Automatic Control 33, 1988.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from du2025_bus import Part
from numba import njit

from weighbridge.balance import ForceBalance
from weighbridge.estimators import ekf, hybrid, robust_rls
from weighbridge.kernels import hybrid_mass, mass_ekf
from weighbridge.kernels import robust_rls as rls_kernel
from weighbridge.papers import du2025 as paper
from weighbridge.papers import du2025_bus as papers_bus
from weighbridge.signals import Floats
from weighbridge.vehicle.model import Vehicle


@dataclass(frozen=True, slots=True)
class Interacting:
    """``dwell``: mean time that a model holds [s]; ``mixing``: the filters interact."""

    dwell: float
    mixing: bool

    @property
    def name(self) -> str:
        return f"{'IMM' if self.mixing else 'likelihoods'}, {self.dwell:g} s"


@njit(error_model="numpy")
def _mixed(prob, change, masses, variances):
    """Probabilities before the window (2,), and mass and variance each model begins it with."""
    ahead, mass, var = np.empty(2), np.empty(2), np.empty(2)
    for j in range(2):
        weight = np.empty(2)
        for i in range(2):
            weight[i] = prob[i] * (1.0 - change if i == j else change)
        ahead[j] = weight.sum()
        weight /= ahead[j]
        mass[j] = weight[0] * masses[0] + weight[1] * masses[1]
        var[j] = 0.0
        for i in range(2):
            var[j] += weight[i] * (variances[i] + (masses[i] - mass[j]) ** 2)
    return ahead, mass, var


@njit(error_model="numpy")
def _run(state, columns, phi, y, params, change, mixing):
    """Blended mass (n,) and probability of the least squares (n,); NaN before both have begun."""
    n = columns.time.size
    found, share = np.full(n, np.nan), np.full(n, np.nan)
    prob = np.array([0.5, 0.5])
    masses, variances = np.zeros(2), np.zeros(2)
    for k in range(n):
        before = state.rls
        row = hybrid_mass.mass_ekf.row_at(columns, k)
        state, mean_phi, mean_y, _, _ = hybrid_mass.step(state, row, phi[k], y[k], params)
        if not state.started:
            continue
        if np.isfinite(mean_phi):
            old = state.rivals
            noise = rls_kernel.floor_var(before, params.rls) * params.rls.dependence
            errors = (
                mean_y - mean_phi * before.mass - before.offset,
                mean_y - (mean_phi - params.ekf.gravity * old.offset) * old.mass,
            )
            ahead = _mixed(prob, change, masses, variances)[0]
            for j in range(2):
                spread = noise + mean_phi * mean_phi * variances[j]
                prob[j] = ahead[j] * np.exp(-0.5 * errors[j] ** 2 / spread) / np.sqrt(spread)
            total = prob.sum()
            prob = prob / total if total > 0.0 else np.array([0.5, 0.5])
            if mixing:
                state = _begun(state, prob, change, params)
        masses[0], masses[1] = state.rls.mass, state.ekf.x[mass_ekf.MASS]
        variances[0] = rls_kernel.variance(state.rls, params.rls)
        variances[1] = state.ekf.cov[mass_ekf.MASS, mass_ekf.MASS]
        found[k] = prob[0] * masses[0] + prob[1] * masses[1]
        share[k] = prob[0]
    return found, share


@njit(error_model="numpy")
def _begun(state, prob, change, params):
    """Put the mixed mass and its variance into both filters."""
    at = mass_ekf.MASS
    masses = np.array([state.rls.mass, state.ekf.x[at]])
    first = rls_kernel.variance(state.rls, params.rls)
    _, mass, var = _mixed(prob, change, masses, np.array([first, state.ekf.cov[at, at]]))
    old = state.rls
    rls = rls_kernel.RobustRlsState(
        mass[0], old.offset, old.information * first / var[0], old.sum_weight,
        old.sum_weighted * np.sqrt(first / var[0]), old.noise_var, old.windows, old.count,
        old.begin, old.last, old.sum_phi, old.sum_y,
    )  # fmt: skip
    x, cov = state.ekf.x.copy(), state.ekf.cov.copy()
    x[at] = mass[1]
    cov[at, at] = max(var[1], cov[at, at])
    kalman = mass_ekf.MassEkfState(x, cov, state.ekf.row)
    return hybrid_mass.HybridState(
        rls, kalman, state.started, state.rivals, state.share, state.mass, state.var
    )


def interacting_mass(balance: ForceBalance, vehicle: Vehicle, way: Interacting) -> Floats:
    """Running mass (n,) by the two filters of `hybrid` with their defaults [kg]."""
    settings = hybrid.HybridSettings()
    balance, vehicle = robust_rls.as_set(balance, vehicle, settings.ekf.start)
    phi, y, valid = robust_rls.rows(balance.table, vehicle, settings.ekf.start)
    params = hybrid.parameters(settings, vehicle, robust_rls.row_period(balance.table.time))
    begin = robust_rls.initial_state(settings.ekf.start, params.rls.window)
    change = min(0.5, params.rls.window / way.dwell)
    return _run(
        hybrid_mass.initial_state(begin, params),
        ekf.columns(balance, vehicle, valid, settings.ekf), phi, y, params, change, way.mixing,
    )[0]  # fmt: skip


DRIVES = 3
"""Of each kind at each load, of the seeds that the blends are judged on too. The time of 20 s was
chosen on 170 004 and 170 005."""

WAYS = tuple(Interacting(dwell, mixing) for mixing in (True, False) for dwell in (5.0, 20.0, 100.0))

SHOWN = ("robust-rls", "ekf", "innovations", *(way.name for way in WAYS))

KINDS = {"paper": "as in the paper", "road": "all effects"}


def judged(drive: paper.DriveResult, vehicle: Vehicle) -> dict[str, float]:
    """RMSE of one drive by each way, from the paper's 21 s on [kg]."""
    balance = drive.tracks["hybrid"].balance
    late = balance.table.time >= balance.table.time[0] + paper.CONVERGED
    found = {m: drive.late_rmse[m] for m in ("robust-rls", "ekf")}
    found["innovations"] = drive.blends["innovations"]
    for way in WAYS:
        mass = interacting_mass(balance, vehicle, way)
        found[way.name] = paper.rms(mass[late] - drive.true_mass)
    return found


def table(found: dict[tuple[str, str], list[dict[str, float]]]) -> str:
    """One row a kind and load, then what each way has over the better filter."""
    lines = ["| drives | " + " | ".join(SHOWN) + " |", "|---" * (1 + len(SHOWN)) + "|"]
    over = []
    for (kind, load), drives in found.items():
        means = {name: float(np.mean([d[name] for d in drives])) for name in SHOWN}
        better = min(means["robust-rls"], means["ekf"])
        over.append([means[name] / better for name in SHOWN])
        cells = " | ".join(f"{means[name]:.0f}" for name in SHOWN)
        lines.append(f"| {KINDS[kind]}, {load} | {cells} |")
    ratios = np.array(over)
    for words, values in (("mean", ratios.mean(axis=0)), ("worst", ratios.max(axis=0))):
        cells = " | ".join(f"{x:.2f}" for x in values)
        lines.append(f"| over the better filter, {words} | {cells} |")
    return "\n".join(lines)


def interacting(done: paper.Reproduction | None = None) -> Part:
    """Judge on the drives of the reproduction."""
    done = done or paper.reproduce(drives=DRIVES)
    known = papers_bus.known_bus()
    found = {
        (kind, load): [judged(d, vehicle) for d in drives if d.load == load]
        for kind, drives, vehicle in (
            ("paper", done.drives, known), ("road", done.road, done.vehicle)
        )
        for load in papers_bus.LOADS
    }  # fmt: skip
    return Part({"interacting": table(found)})
