"""The mass as a slope: regressor and right-hand side of the longitudinal law."""

from __future__ import annotations

from weighbridge.balance.law import force_on_mass, mass_column
from weighbridge.balance.table import ForceTable
from weighbridge.signals import Floats
from weighbridge.vehicle import Vehicle


def regression(table: ForceTable, vehicle: Vehicle) -> tuple[Floats, Floats]:
    """Regressor and right-hand side of the mass (Jensen 2022, eqs. 5, 6).

    Returns
    -------
    phi : (n,) [m/s^2]
    y : (n,) [N]
    """
    return mass_column(table, vehicle), force_on_mass(table, vehicle)
