"""Drivers drawn at random, each of a style."""

import numpy as np

from .motion import Driver
from .vehicle import Vehicle

STYLES = ("ordinary", "calm", "brisk", "motorway", "city", "delivery")


def random_driver(vehicle: Vehicle, style: str, rng: np.random.Generator) -> Driver:
    """Draw a driver for a vehicle."""
    u = rng.uniform
    heavy = vehicle.kind in ("truck", "semi", "electric_bus")
    # 0 calm to 1 brisk; drivers of one style differ.
    heat = {"calm": u(0.0, 0.35), "brisk": u(0.65, 1.0)}.get(style, u(0.2, 0.75))
    accel = (0.7 if heavy else 1.3) + (0.7 if heavy else 1.7) * heat
    diesel = vehicle.engine.heating > 0.0 and vehicle.engine.limit < 520.0
    low = (0.40 if diesel else 0.30) + (0.14 if diesel else 0.16) * heat + u(-0.03, 0.03)
    lug = (0.30 if diesel else 0.21) + 0.07 * heat + u(-0.02, 0.02)
    if heavy:
        low, lug = 0.60 + 0.08 * heat, 0.42 + 0.05 * heat
    return Driver(
        accel=accel,
        accel_speed=u(7.0, 12.0),
        decel=(0.5 + 0.6 * heat) if heavy else (0.7 + 0.9 * heat),
        patience=u(0.10, 0.35),
        interval=u(0.2, 0.5),
        feel=u(0.88, 1.12),
        pace=0.92 + 0.16 * heat,
        top_speed=vehicle.top_speed,
        headway=2.2 - 1.1 * heat,
        hardest=3.5 if heavy else 6.0,
        up_low=low,
        up_high=(0.92 if heavy else 0.72 + 0.2 * heat),
        lug=lug,
        skip=u(0.0, 0.25) if vehicle.box.ratios.size < 9 else u(0.4, 0.7),
        neutral=u(0.0, 0.2) if vehicle.box.robot == 0 else 0.0,
        rest=u(0.02, 0.2),
        pre_brake=u(0.2, 0.6),
        overlap=u(0.03, 0.25),
        cruise=int(u() < (0.8 if heavy or style == "motorway" else 0.35)),
        overtake=1.0 / u(150.0, 400.0) * (0.3 + heat) * (0.2 if heavy else 1.0),
        leaders=1.0 / u(20.0, 60.0),
        lateral=(1.0 + 0.5 * heat) if heavy else (1.6 + 1.8 * heat),
    )
