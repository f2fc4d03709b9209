"""A vehicle class with wide standard deviations."""

from weighbridge.vehicle.classes import VehicleClass

rickshaw = VehicleClass(
    name="rickshaw",
    mass_range=(300.0, 2_500.0),
    typical_mass=1400.0,
    emptied=100.0,
    loaded=2.5,
    heaviest=3.0,
    drag_area=(0.7, 0.2),
    rolling_coefficient=(0.012, 0.004),
    engine_inertia=(0.15, 0.06),
    wheel_inertia=(5.0, 1.0),
    drag_area_range=(0.3, 1.2),
    rolling_coefficient_range=(0.002, 0.03),
    engine_inertia_range=(0.02, 1.0),
    wheel_inertia_range=(2.0, 12.0),
    efficiency=(0.93, 0.03),
    tyre="205/55 R16",
    fastest=60.0,
    strongest=120.0,
)
