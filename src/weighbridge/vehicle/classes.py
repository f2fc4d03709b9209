"""Classes of vehicles, one record each: what they have in common, where nothing else is known.

A new class is a record in `VEHICLE_CLASSES`, or in the entry points
``weighbridge.vehicle_classes`` of another package.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from weighbridge.registry import Registry
from weighbridge.signals import Floats

Usual = tuple[float, float]
"""Mean and standard deviation."""

Range = tuple[float, float]
"""Least and largest value."""

MOTOR_INERTIA: Final[Usual] = (0.045, 0.02)
"""Rotor with reduction gear of an electric car with one gear, at the motor [kg m^2]: rotors of
20 kg and 0.16 m across weigh in with 0.06, small ones with 0.02. Those of other classes are
larger as their engines are."""

CAR_ENGINE_INERTIA: Final = 0.15
"""That of a car's engine [kg m^2] (Jensen 2022, sec. 7.3)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleClass:
    """What vehicles of a class have in common.

    Attributes
    ----------
    name : in vehicle files and options
    mass_range : from the lightest empty one to an overloaded one with a trailer [kg]: outside,
        data or vehicle file are wrong
    typical_mass : of one whose tare is unknown, to detect braking [kg]
    emptied : what may be missing of an empty vehicle [kg]: driver and fuel
    loaded : largest mass over the tare where the permitted one is not known, without a trailer [-]
    heaviest : above this multiple of the empty mass neither load nor a trailer explains it [-]
    untowed : permitted mass, above which a mass is that of a trailer, or in pounds [kg]; None where
        the class knows none
    drag_area : C_d A [m^2]
    rolling_coefficient : C_r [-]
    engine_inertia, wheel_inertia : of all that turns with the engine, of all wheels [kg m^2]
    drag_area_range, rolling_coefficient_range, engine_inertia_range, wheel_inertia_range : bounds
        of the same in a fit
    efficiency : slope of wheel over engine torque, where the layout is unknown [-]
    layouts : whether the engine may lie across or lengthwise, with an efficiency of each
    tyre : usual size
    squat_growth : power of the mass with which the squat grows [-]: of springs that stay as
        stiff, 1
    fastest : speed that it hardly reaches [m/s]
    strongest : acceleration times speed that it hardly reaches [W/kg]
    scatter_std : masses of one vehicle from drive to drive, beside all that is known, standard
        deviation [-]: twice the likeliest of 124 masses of eight trucks and buses, for roads that
        differ more
    boarding_std : change of the mass at a short stop, standard deviation relative to it [-]
    retarded : a retarder or an engine brake may slow it without the brake pedal
    underpowered : it slows down on hills, which biases masses without an accelerometer
        (`weighbridge.estimators.noisy_motion.unmeasured_noise`)
    motor_helps : a motor drives it beside an engine, so that no torque of the engine shows all
    """

    name: str
    mass_range: Range
    typical_mass: float
    emptied: float
    loaded: float
    heaviest: float
    untowed: float | None = None
    drag_area: Usual
    rolling_coefficient: Usual
    engine_inertia: Usual
    wheel_inertia: Usual
    drag_area_range: Range
    rolling_coefficient_range: Range
    engine_inertia_range: Range
    wheel_inertia_range: Range
    efficiency: Usual
    layouts: bool = False
    tyre: str
    squat_growth: float = 1.0
    fastest: float
    strongest: float
    scatter_std: float = 0.0
    boarding_std: float = 0.0
    retarded: bool = False
    underpowered: bool = False
    motor_helps: bool = False

    def road_prior(self, *, single_speed: bool) -> tuple[Floats, Floats]:
        """Return C_d A, C_r, I_e, I_w and their standard deviations (4,).

        Parameters
        ----------
        single_speed : one gear, so a motor in place of an engine
        """
        usual = (self.drag_area, self.rolling_coefficient, self.engine_inertia, self.wheel_inertia)
        mean, std = np.array(usual).T.copy()
        if single_speed:
            share = mean[2] / CAR_ENGINE_INERTIA
            mean[2], std[2] = share * MOTOR_INERTIA[0], share * MOTOR_INERTIA[1]
        return mean, std

    @property
    def road_bounds(self) -> tuple[Floats, Floats]:
        """Lower and upper bounds of C_d A, C_r, I_e, I_w (4,) in a fit."""
        ranges = (
            self.drag_area_range,
            self.rolling_coefficient_range,
            self.engine_inertia_range,
            self.wheel_inertia_range,
        )
        low, high = np.array(ranges).T.copy()
        return low, high


FASTEST: Final = 72.0
"""Speed that no road vehicle reaches in ordinary driving [m/s]."""

STRONGEST: Final = 150.0
"""Acceleration times speed that hardly any reaches [W/kg]: recorded cars stay below 55 W/kg."""

CAR: Final = VehicleClass(
    name="car",
    mass_range=(250.0, 8_000.0),
    typical_mass=1500.0,
    emptied=130.0,
    loaded=1.8,
    heaviest=2.6,
    # The driving licence.
    untowed=3500.0,
    drag_area=(0.65, 0.25),
    rolling_coefficient=(0.010, 0.004),
    engine_inertia=(CAR_ENGINE_INERTIA, 0.06),
    wheel_inertia=(5.0, 0.7),
    drag_area_range=(0.30, 1.00),
    rolling_coefficient_range=(0.002, 0.030),
    engine_inertia_range=(0.02, 1.00),
    wheel_inertia_range=(2.0, 12.0),
    efficiency=(0.95, 0.020),
    layouts=True,
    tyre="205/55 R16",
    # Springs of cars are level or progressive.
    squat_growth=0.0,
    fastest=FASTEST,
    strongest=STRONGEST,
)
"""A car with an engine or a motor alone."""

VEHICLE_CLASSES: Final = Registry(
    VehicleClass,
    "weighbridge.vehicle_classes",
    (
        VehicleClass(
            name="motorcycle",
            mass_range=(60.0, 900.0),
            typical_mass=280.0,
            emptied=20.0,
            # With rider, passenger and luggage: its mass in running order is without them.
            loaded=2.8,
            heaviest=4.0,
            drag_area=(0.50, 0.20),
            rolling_coefficient=(0.018, 0.006),
            engine_inertia=(0.02, 0.01),
            wheel_inertia=(1.1, 0.3),
            drag_area_range=(0.20, 1.20),
            rolling_coefficient_range=(0.005, 0.040),
            engine_inertia_range=(0.002, 0.15),
            wheel_inertia_range=(0.2, 3.0),
            efficiency=(0.92, 0.03),
            tyre="180/55 ZR17",
            fastest=85.0,
            strongest=400.0,
        ),
        VehicleClass(
            name="racer",
            mass_range=(120.0, 900.0),
            typical_mass=270.0,
            emptied=80.0,
            loaded=1.8,
            heaviest=2.2,
            drag_area=(1.00, 0.40),
            rolling_coefficient=(0.018, 0.007),
            engine_inertia=(0.02, 0.01),
            wheel_inertia=(0.9, 0.3),
            drag_area_range=(0.30, 2.50),
            rolling_coefficient_range=(0.005, 0.040),
            engine_inertia_range=(0.002, 0.15),
            wheel_inertia_range=(0.2, 3.0),
            efficiency=(0.92, 0.03),
            tyre="165/55 R13",
            fastest=60.0,
            strongest=400.0,
        ),
        VehicleClass(
            name="quad",
            mass_range=(120.0, 1_800.0),
            typical_mass=430.0,
            emptied=20.0,
            loaded=2.4,
            heaviest=4.0,
            drag_area=(0.80, 0.25),
            rolling_coefficient=(0.022, 0.008),
            engine_inertia=(0.03, 0.015),
            wheel_inertia=(2.4, 0.8),
            drag_area_range=(0.40, 1.60),
            rolling_coefficient_range=(0.005, 0.060),
            engine_inertia_range=(0.002, 0.30),
            wheel_inertia_range=(0.5, 8.0),
            # Most have a belt that slips and is squeezed.
            efficiency=(0.87, 0.05),
            tyre="255/65 R12",
            fastest=40.0,
            strongest=200.0,
        ),
        CAR,
        replace(CAR, name="hybrid", motor_helps=True),
        VehicleClass(
            name="van",
            mass_range=(600.0, 15_000.0),
            typical_mass=2500.0,
            emptied=160.0,
            loaded=2.2,
            heaviest=3.2,
            drag_area=(1.30, 0.50),
            rolling_coefficient=(0.010, 0.004),
            engine_inertia=(0.30, 0.12),
            wheel_inertia=(8.0, 1.5),
            drag_area_range=(0.60, 3.00),
            rolling_coefficient_range=(0.004, 0.030),
            engine_inertia_range=(0.05, 1.50),
            wheel_inertia_range=(3.0, 20.0),
            efficiency=(0.945, 0.025),
            layouts=True,
            tyre="235/65 R16",
            fastest=FASTEST,
            strongest=STRONGEST,
        ),
        VehicleClass(
            name="bus",
            mass_range=(1_500.0, 45_000.0),
            typical_mass=13_000.0,
            emptied=350.0,
            loaded=2.2,
            heaviest=2.6,
            drag_area=(5.0, 1.5),
            rolling_coefficient=(0.008, 0.003),
            engine_inertia=(2.0, 0.8),
            wheel_inertia=(80.0, 20.0),
            drag_area_range=(2.50, 8.00),
            rolling_coefficient_range=(0.003, 0.020),
            engine_inertia_range=(0.30, 6.00),
            wheel_inertia_range=(20.0, 150.0),
            efficiency=(0.94, 0.025),
            scatter_std=0.012,
            tyre="275/70 R22.5",
            fastest=45.0,
            strongest=60.0,
            boarding_std=0.025,
            retarded=True,
        ),
        VehicleClass(
            name="truck",
            mass_range=(1_500.0, 80_000.0),
            typical_mass=15_000.0,
            emptied=400.0,
            # A truck may carry several times its tare.
            loaded=8.0,
            heaviest=8.0,
            drag_area=(5.5, 1.5),
            rolling_coefficient=(0.007, 0.003),
            engine_inertia=(2.5, 1.0),
            wheel_inertia=(110.0, 30.0),
            drag_area_range=(2.50, 10.0),
            rolling_coefficient_range=(0.003, 0.020),
            engine_inertia_range=(0.30, 6.00),
            wheel_inertia_range=(20.0, 300.0),
            efficiency=(0.95, 0.020),
            scatter_std=0.012,
            tyre="315/80 R22.5",
            fastest=45.0,
            strongest=60.0,
            retarded=True,
            underpowered=True,
        ),
    ),
)
"""Every class of vehicles, the lightest first.

``emptied``: a driver of 75 kg and a tank of 60, 90, 300 or 400 litres. ``loaded``: without a
trailer cars carry half of their tare and vans three quarters. ``heaviest``: cars of 1.4 t may draw
as much again and carry 0.5 t, tractors of 6 t make 40 t and more. ``drag_area`` and the others
with standard deviations: Gillespie, Fundamentals of Vehicle Dynamics, 1992, ch. 4; I_e as in Jensen
2022, sec. 7.3, for cars and in proportion to engines for the others; I_w is that of all wheels:
those of a car weigh 17 to 22 kg with a radius of gyration of 0.25 m, 1.1 to 1.4 kg m^2 each, a
truck's 100 kg and 0.4 m, 16 kg m^2 each. Their ranges: cars from Jensen 2022, Table 5; the others
spanning the usual values of Gillespie. ``efficiency``: cars and vans stand between both layouts;
trucks: 0.99 in a direct and 0.96 in other gears (Regulation (EU) 2017/2400, Annex VI, App. 8),
times 0.98 in a single reduction axle without its drag (Annex VII); buses have automatic gearboxes.
Motorcycles, racers (built by students) and quads: chosen, and wide, for no source was at hand;
their mass in running order is without the rider (Regulation (EU) 168/2013, Art. 5).
``boarding_std``: nine passengers of 71 kg get on and as many off, each by chance, a
bus of 12 t. ``tyre``: those of cars lie within 6 % of its radius, of trucks within 8 %."""
