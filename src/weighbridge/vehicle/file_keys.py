"""What every key of a vehicle file is, its unit, and which field it fills."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final, Literal

from weighbridge.vehicle.driveline import Driveline, Mounting, RoadLoad
from weighbridge.vehicle.provenance import Provenance
from weighbridge.vehicle.ride import Ride
from weighbridge.vehicle.speed_model import SpeedModel
from weighbridge.vehicle.torque_model import DraggedReading, Timing, TorqueModel

Kind = Literal["text", "texts", "number", "numbers", "triangle", "count"]


@dataclass(frozen=True, slots=True)
class Key:
    """One key: ``stem_suffix`` + ``tail``, or the stem alone for a bare number.

    Attributes
    ----------
    stem, suffix, tail : of its name; the suffix is its unit
    field : that it fills
    comment : what stands behind it
    kind : of its value
    pair : whether it is two numbers, the lower first
    earlier : stem of its name in files of earlier versions
    """

    stem: str
    field: str
    comment: str
    kind: Kind = "number"
    suffix: str = ""
    tail: str = ""
    pair: bool = False
    earlier: str = ""

    @property
    def name(self) -> str:
        """As it is in a file."""
        return (f"{self.stem}_{self.suffix}" if self.suffix else self.stem) + self.tail


_PER_MPS2: Final = "_per_mps2"

VEHICLE_KEYS: Final = (
    Key("name", "name", "for people", "text"),
    Key("class", "kind", "such as car, van, bus, truck or motorcycle", "text"),
    Key("type", "type", "make and model, shared by vehicles that are built alike", "text"),
    Key("engine", "engine", "petrol, diesel or electric", "text"),
    Key("tare", "tare", "mass without payload; the payload is counted from it", suffix="kg"),
    Key("gross", "gross", "permitted mass", suffix="kg"),
    Key("mapping", "mapping", "mapping TOML of its logs, seen from this file's folder", "text"),
)

WITNESS_KEYS: Final = (
    Key(
        "coefficients",
        "coefficients",
        "reading = c0 + c1 w + c2 w N + c3 w^2, by a battery c0 + c1 w + c2 / N; w and N as parts "
        "of the upper ends of their ranges",
        "numbers",
    ),
    Key("scatter", "scatter", "standard deviation about it; a share for load, else N m"),
    Key("span", "span", "range of the reading"),
    Key("scale_std", "scale_std", "by how much its scale differs between drives"),
    Key("value_range", "value_range", "w it has seen, in SI", "numbers", pair=True),
    Key("speed_range", "speed_range", "N it has seen", "numbers", "rpm", pair=True),
    Key("lag", "lag", "by how much it is later than w", suffix="s"),
    Key("pressure", "pressure", "of the air on the drives", suffix="kpa"),
    Key("temperature", "temperature", "of the air on the drives", suffix="degc"),
)

SECTIONS: Final[dict[str, tuple[type[Any], tuple[Key, ...]]]] = {
    "driveline": (
        Driveline,
        (
            Key(
                "gearings_per_m",
                "gearings",
                "engine radians per metre travelled, gear by gear: ratio * final drive / radius",
                "numbers",
            ),
            Key("gearing_stds_per_m", "gearing_stds", "their standard deviations", "numbers"),
            Key(
                "gearing_range_per_m",
                "gearing_range",
                "of a stepless gearbox in place of gearings: the lowest and the highest",
                "numbers",
                pair=True,
            ),
            Key(
                "engine_inertia", "engine_inertia", "all that turns with the engine", suffix="kgm2"
            ),
            Key(
                "engine_inertia_std",
                "engine_inertia_std",
                "its standard deviation; 0 where a bound held it",
                suffix="kgm2",
            ),
            Key("wheel_inertia", "wheel_inertia", "all wheels together", suffix="kgm2"),
            Key(
                "wheel_inertia_std",
                "wheel_inertia_std",
                "its standard deviation; 0 where a bound held it",
                suffix="kgm2",
            ),
            Key("wheel_radius", "wheel_radius", "effective rolling radius", suffix="m"),
            Key("driven", "driven", "which axles are: front, rear or all", "text"),
            Key("layout", "layout", "of a car or van: transverse or longitudinal", "text"),
            Key(
                "efficiency",
                "efficiency",
                "wheel over engine power; 1 where torque was calibrated at the wheels",
            ),
            Key("speed_scale", "speed_scale", "indicated over true speed"),
            Key(
                "idle_speed",
                "idle_speed",
                "0 for a motor that stands, or where no drive shows it",
                suffix="rpm",
            ),
        ),
    ),
    "torque": (
        TorqueModel,
        (
            Key("source", "source", "how torque is found, such as load or measured", "text"),
            Key(
                "coefficients",
                "coefficients",
                "in SI; load: w0, w1 per load, w2, w3 ... per power of engine speed; "
                "measured and percent: offset, scale, then powers of engine speed",
                "numbers",
            ),
            Key("coefficient_stds", "coefficient_stds", "their standard deviations", "numbers"),
            Key("curvature", "curvature", "of load * engine speed and of load^2", "numbers"),
            Key("curvature_stds", "curvature_stds", "their standard deviations", "numbers"),
            Key("knots", "knots", "engine speeds of a correction of w1", "numbers", "rpm"),
            Key("knot_slopes", "knot_slopes", "the correction there", "numbers"),
            Key(
                "reference_torque",
                "reference_torque",
                "100 % torque, where the drive does not say it",
                suffix="nm",
            ),
            Key(
                "reported_reference_torque",
                "reported_reference_torque",
                "100 % torque, as the drives of the calibration reported it",
                suffix="nm",
                earlier="told_reference_torque",
            ),
            Key(
                "reading_step",
                "reading_step",
                "steps of the reading in the drives of the calibration, in SI",
            ),
            Key("engine_efficiency", "engine_efficiency", "shaft over fuel power, for air_flow"),
            Key("noise", "noise", "standard deviation of the torque", suffix="nm"),
            Key("scale_std", "scale_std", "of a torque never calibrated: how sure its scale is"),
            Key("load_range", "load_range", "loads the fit has seen", "numbers", "pct", pair=True),
            Key(
                "speed_range",
                "speed_range",
                "engine speeds the fit has seen",
                "numbers",
                "rpm",
                pair=True,
            ),
            Key(
                "charge",
                "charge",
                "air that a full cylinder took in the calibration, over 101.3 kPa and 298 K",
            ),
            Key("charge_exponent", "charge_exponent", "torque at one load grows with its power"),
            Key("charge_exponent_std", "charge_exponent_std", "its standard deviation"),
        ),
    ),
    "road_load": (
        RoadLoad,
        (
            Key("drag_area", "drag_area", "drag coefficient times frontal area", suffix="m2"),
            Key("rolling_coefficient", "rolling_coefficient", "rolling resistance over weight"),
            Key(
                "rolling_speed_coefficient_s_per_m",
                "rolling_speed_coefficient",
                "what is added to it per m/s of speed",
            ),
            Key("drag_area_std", "drag_area_std", "its standard deviation", suffix="m2"),
            Key("rolling_coefficient_std", "rolling_coefficient_std", "its standard deviation"),
        ),
    ),
    "mounting": (
        Mounting,
        (
            Key(
                "roll",
                "roll",
                "sensor to body axes (forward, right, down): about x first",
                suffix="deg",
            ),
            Key("pitch", "pitch", "then about y", suffix="deg"),
            Key("yaw", "yaw", "then about z", suffix="deg"),
            Key("std", "std", "standard deviations of the three", "numbers", "deg"),
            Key(
                "squat",
                "squat",
                "nose-up lean of the body per specific force along the road",
                suffix="deg",
                tail=_PER_MPS2,
            ),
            Key("squat_std", "squat_std", "its standard deviation", suffix="deg", tail=_PER_MPS2),
        ),
    ),
    "timing": (
        Timing,
        (
            Key("torque_delay", "torque_delay", "how late torque or load is stamped", suffix="s"),
            Key("torque_delay_std", "torque_delay_std", "its standard deviation", suffix="s"),
            Key("torque_lag", "torque_lag", "time constant of its smoothing", suffix="s"),
        ),
    ),
    "dragged": (
        DraggedReading,
        (
            Key(
                "engine_speed",
                "engine_speed",
                "engine dragged, no foot on the accelerator: at these speeds",
                "numbers",
                "rpm",
            ),
            Key(
                "level",
                "level",
                "it reads so little: a share for load and percent, else N m, kg/s",
                "numbers",
            ),
            Key("scatter", "scatter", "standard deviation of such readings"),
            Key("span", "span", "range of the reading up to the highest"),
            Key("reach", "reach", "how far above the level idle charge may lift it"),
        ),
    ),
    "speed_model": (
        SpeedModel,
        (
            Key("mass", "mass", "known mass of the fit; the filter starts there", suffix="kg"),
            Key("sample_time", "sample_time", "between samples of the speed", suffix="s"),
            Key("averaged", "averaged", "part of it over which the speed is averaged"),
            Key("slowest", "slowest", "slower samples are off", suffix="mps"),
            Key("hardest", "hardest", "samples that slow down by more are off", suffix="mps2"),
            Key("force_gain_per_m", "force_gain", "a1, traction force per engine torque"),
            Key("drag_kg_per_m", "drag", "a2, air density times drag area"),
            Key("rolling_coefficient", "rolling_coefficient", "f_r, rolling resistance / weight"),
            Key("rotating_mass", "rotating_mass", "m_r of wheels and driveline", suffix="kg"),
            Key("corrections", "corrections", "p1 to p7 of the fit, in SI", "numbers"),
            Key("r_squared", "r_squared", "part of the speed's changes that the fit explains"),
            Key("samples", "samples", "windows of the fit", "count"),
            Key("scale_std", "scale_std", "part of any mass found so, as standard deviation"),
        ),
    ),
    "ride": (
        Ride,
        (
            Key(
                "front_stiffness",
                "front_stiffness",
                "of the spring at each front wheel",
                suffix="npm",
            ),
            Key(
                "rear_stiffness", "rear_stiffness", "of the spring at each rear wheel", suffix="npm"
            ),
            Key(
                "front_damping", "front_damping", "of the damper at each front wheel", suffix="nspm"
            ),
            Key("rear_damping", "rear_damping", "of the damper at each rear wheel", suffix="nspm"),
            Key("front_track", "front_track", "between the front wheels", suffix="m"),
            Key("rear_track", "rear_track", "between the rear wheels", suffix="m"),
            Key(
                "front_axle",
                "front_axle",
                "from the centre of gravity to the front axle",
                suffix="m",
            ),
            Key(
                "rear_axle", "rear_axle", "from the centre of gravity to the rear axle", suffix="m"
            ),
            Key("front_unsprung", "front_unsprung", "front axle and its wheels", suffix="kg"),
            Key("rear_unsprung", "rear_unsprung", "rear axle and its wheels", suffix="kg"),
            Key("sprung_mass", "sprung_mass", "roughly; an estimate begins here", suffix="kg"),
            Key("roll_inertia", "roll_inertia", "of the sprung mass, roughly", suffix="kgm2"),
            Key("pitch_inertia", "pitch_inertia", "of the sprung mass, roughly", suffix="kgm2"),
            Key(
                "zero_mass",
                "zero_mass",
                "sprung mass with which the travel sensors read zero at rest",
                suffix="kg",
            ),
            Key(
                "force_std",
                "force_std",
                "part by which all springs and dampers together may be off",
            ),
            Key("travel_noise", "travel_noise", "of one sample, as standard deviation", suffix="m"),
            Key("rate_noise", "rate_noise", "of one sample", suffix="mps"),
            Key(
                "vertical_velocity_noise", "vertical_velocity_noise", "of one sample", suffix="mps"
            ),
            Key("roll_rate_noise", "roll_rate_noise", "of one sample", suffix="radps"),
            Key("pitch_rate_noise", "pitch_rate_noise", "of one sample", suffix="radps"),
        ),
    ),
    "provenance": (
        Provenance,
        (
            Key("drives", "drives", "drives of the calibration", "texts"),
            Key("masses", "masses", "their known masses", "numbers", "kg"),
            Key("date", "date", "of the calibration", "text"),
            Key("r_squared", "r_squared", "of the torque fit"),
            Key("residual_std", "residual_std", "of the torque fit", suffix="nm"),
            Key("samples", "samples", "used by the fit", "count"),
            Key("method", "method", "what was fitted: joint, rls or speed-ekf", "text"),
            Key("motion", "motion", "how the motion of the drives was found", "text"),
            Key(
                "unmeasured_grade",
                "unmeasured_grade",
                "what of the grade nothing had measured in them, as standard deviation",
                suffix="rad",
            ),
            Key(
                "torque_period",
                "torque_period",
                "from one sample of the torque to the next in them",
                suffix="s",
            ),
            Key(
                "mass_scale_std",
                "mass_scale_std",
                "part of any mass weighed with this file, as standard deviation",
            ),
            Key(
                "std_factor",
                "std_factor",
                "scatter of parts of the drives over what the filter says of it",
            ),
            Key("highest_torque", "highest_torque", "of the drives", suffix="nm"),
            Key(
                "torque_use",
                "torque_use",
                "how far an error of that size, at 18 parts of it, moved their masses",
                "numbers",
            ),
            Key(
                "switched_power",
                "switched_power",
                "of an accessory that went on and off in them",
                suffix="w",
            ),
            Key(
                "dbc", "dbc", "DBC files they were read with, seen from this file's folder", "texts"
            ),
            Key("notes", "notes", "free text", "text"),
            Key("doubts", "doubts", "on its masses, reported at each weighing", "texts"),
            Key(
                "fit_cov",
                "fit_cov",
                "covariance of the fit beside that part, lower triangle in SI: coefficients, "
                "curvature, knot slopes, drag area, rolling coefficient, engine and wheel inertia",
                "triangle",
            ),
        ),
    ),
}
