"""Vehicles drawn at random, each of a kind."""

from dataclasses import dataclass

import numpy as np

from .motion import (
    CONVERTER,
    DUAL_CLUTCH,
    FIXED,
    MANUAL,
    VARIATOR,
    Body,
    Engine,
    Gearbox,
)

RPM = np.pi / 30.0
GRID = 121


@dataclass(frozen=True, slots=True, kw_only=True)
class Ecu:
    """What the control units believe and send.

    Attributes
    ----------
    torque : "load", "nm" or "percent": what the log holds
    reference_torque : of the percent [N m]
    scale : sent over true torque [-]
    part_load : further relative error at small load, fading to full load [-]
    map_error : amplitude of the smooth error over engine speed and load [-]
    map_phase : (4,) where on the map its waves lie
    friction_error : the control unit's friction over the true one [-]
    cold_known : part of the cold friction the control unit knows of [-]
    overrun_load : load sent while the fuel is cut [-]
    smoothing : time constant of the values sent [s]
    rotor_fade : loss of motor torque with a hot rotor that is not sent [-]
    speed_slip : part of the tyre slip in the speed: 0 undriven wheels, 1 gearbox output [-]
    speed_scale : sent over true speed [-]
    speed_growth : growth of the tyre at 40 m/s [-]
    speed_step : [m/s]
    speed_floor : whether the speed is cut off rather than rounded
    rpm_step : [rpm]
    cell_voltage : of the battery, empty and full [V]; 0 without
    resistance : of the battery [ohm]
    """

    torque: str
    reference_torque: float
    scale: float
    part_load: float
    map_error: float
    map_phase: tuple[float, float, float, float]
    friction_error: float
    cold_known: float
    overrun_load: float
    smoothing: float
    rotor_fade: float
    speed_slip: float
    speed_scale: float
    speed_growth: float
    speed_step: float
    speed_floor: bool
    rpm_step: float
    cell_voltage: tuple[float, float] = (0.0, 0.0)
    resistance: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Hybrid:
    """A motor beside the engine, see ``gearboxes``.

    Attributes
    ----------
    layout : "power_split", "parallel_hybrid" or "mild_hybrid"
    engine_power, motor_power, motor_torque : most that they give [W, W, N m]
    start_power, fastest_alone : the engine runs above this power or speed [W, m/s]
    capacity, voltage : of the battery [J, V]
    efficiency, mechanical : of motor with battery, of what lies before the wheels [-]
    charging : part of the motor's power for all of the charge that is missing [-]
    best_torque : of the engine, over its highest; the motor gives what is above it [-]
    slow, fast, bend, lag : engine speeds of a power split at no and at full power [rad/s], with
        which power of the power it rises, how late [s]
    """

    layout: str
    engine_power: float
    motor_power: float
    motor_torque: float
    start_power: float
    fastest_alone: float
    capacity: float
    voltage: float
    efficiency: float
    mechanical: float
    charging: float
    best_torque: float
    slow: float
    fast: float
    bend: float
    lag: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Vehicle:
    """One vehicle.

    Attributes
    ----------
    name, kind : of the vehicle
    tare, gross : mass with driver and fuel, and the most allowed [kg]
    engine, box, body : what it is made of
    ecu : what it sends
    top_speed : by law or governor [m/s]
    cylinders : number, for the engine's vibration; 0 for a motor
    hybrid : motor beside the engine; None without
    """

    name: str
    kind: str
    tare: float
    gross: float
    engine: Engine
    box: Gearbox
    body: Body
    ecu: Ecu
    top_speed: float
    cylinders: int
    hybrid: Hybrid | None = None


def _curve(kind: str, peak: float, power: float, limit: float, rng) -> tuple[np.ndarray, float]:
    """Full-load torque over engine speed: a smooth curve with one broad top."""
    top = 1.15 * limit
    w = np.linspace(0.0, top, GRID)
    x = w / limit
    if kind == "suction":
        at_peak = rng.uniform(0.60, 0.72)
        width = rng.uniform(0.75, 0.95)
        shape = 1.0 - 0.5 * ((x - at_peak) / width) ** 2
        shape -= rng.uniform(0.10, 0.25) * np.maximum(x - 0.9, 0.0) / 0.1
        # A shallow dip from the intake's resonance.
        shape -= rng.uniform(0.0, 0.04) * np.exp(-(((x - rng.uniform(0.4, 0.55)) / 0.08) ** 2))
        return np.maximum(peak * shape, 0.1 * peak), top
    rise = rng.uniform(0.22, 0.30) if kind == "turbo" else rng.uniform(0.30, 0.40)
    if kind == "truck":
        rise = rng.uniform(0.42, 0.48)
    start = rng.uniform(0.45, 0.6)
    low = start + (1.0 - start) / (1.0 + np.exp(-(x - rise) / 0.055))
    shape = low * (1.0 - 0.10 * ((x - 0.5) / 0.5) ** 2)
    torque = peak * shape / shape.max()
    # Power is held, then falls off.
    torque = (
        -0.06
        * peak
        * np.logaddexp(-torque / (0.06 * peak), -(power / np.maximum(w, 1.0)) / (0.06 * peak))
    )
    low_power = np.exp(-np.logaddexp(0.0, (x - 1.04) / 0.03) * 0.6)
    torque *= low_power
    return np.maximum(torque, 0.05 * peak), top


def _motor(peak: float, power: float, limit: float) -> tuple[np.ndarray, float]:
    top = 1.1 * limit
    w = np.linspace(0.0, top, GRID)
    torque = np.minimum(peak, power / np.maximum(w, 1.0))
    soft = np.convolve(np.pad(torque, 3, mode="edge"), np.ones(7) / 7.0, mode="valid")
    return soft * np.where(w > limit, np.exp(-(w - limit) / (0.02 * limit)), 1.0), top


def _ratios(first: float, last: float, count: int, bend: float) -> np.ndarray:
    """Gears whose steps shrink upwards, as in cars (Naunheimer, progressive steps)."""
    u = np.linspace(0.0, 1.0, count)
    return np.exp(np.log(first) + (np.log(last) - np.log(first)) * (u + bend * u * (1.0 - u)))


def _input(kind: str, idle: float, limit: float, rng) -> dict[str, float]:
    """How a variator turns its input; nothing of the kind for other boxes."""
    u = rng.uniform
    if kind != "petrol_cvt":
        return {
            "input_low": 0.0, "input_speed": 0.0, "input_pedal": 0.0, "input_bend": 1.0,
            "steps": 1.0, "step_pedal": 2.0, "up_rate": 0.0, "down_rate": 0.0,
        }  # fmt: skip
    return {
        "input_low": u(1.5, 1.9) * idle,
        "input_speed": u(5, 20) * RPM,
        "input_pedal": u(0.5, 0.8) * limit,
        "input_bend": u(1.3, 2.6),
        "steps": float(rng.choice([1.0, u(1.15, 1.35)])),
        "step_pedal": u(0.4, 0.7),
        "up_rate": u(0.3, 1.0),
        "down_rate": u(0.5, 1.5),
    }


_KINDS = {
    # tare, gross, drag area, crr, radius, ...
    "small_petrol": (940, 1100, 390, 0.58, 0.66, 0.0085, 0.0115, 0.278, 0.292),
    "petrol": (1200, 1500, 480, 0.58, 0.68, 0.0080, 0.0110, 0.298, 0.318),
    "petrol_dct": (1300, 1650, 500, 0.58, 0.72, 0.0080, 0.0110, 0.300, 0.330),
    "diesel": (1500, 1950, 560, 0.62, 0.78, 0.0080, 0.0110, 0.310, 0.345),
    "van": (1900, 2350, 1300, 1.15, 1.60, 0.0085, 0.0115, 0.325, 0.350),
    "truck": (7200, 9500, 9000, 4.5, 5.8, 0.0055, 0.0080, 0.470, 0.510),
    "semi": (13800, 14800, 25500, 5.0, 6.3, 0.0048, 0.0065, 0.480, 0.525),
    "electric_car": (1300, 2100, 480, 0.56, 0.72, 0.0075, 0.0100, 0.310, 0.345),
    "electric_bus": (11500, 13500, 6000, 4.6, 5.6, 0.0060, 0.0080, 0.460, 0.490),
}
KINDS = (*_KINDS, "petrol_automatic", "petrol_cvt")
PLACES = 25
_BASES = {"petrol_automatic": "petrol_dct", "petrol_cvt": "petrol"}
# Kinds that came later: the draws of the others stay what they are.
_LATER = ("petrol_cvt",)


def random_vehicle(kind: str, seed: int) -> Vehicle:
    """Draw a vehicle of a kind; the same seed gives the same vehicle.

    Parameters
    ----------
    kind : one of ``KINDS``
    seed : of the draw

    Raises
    ------
    ValueError
        The kind is not known.
    """
    if kind not in KINDS:
        raise ValueError(f"kind {kind!r} is not known; use one of {', '.join(KINDS)}")
    base = _BASES.get(kind, kind)
    order = (*sorted(set(KINDS) - set(_LATER)), *_LATER)
    rng = np.random.default_rng([seed, order.index(kind), 77])
    u = rng.uniform
    low, high, payload, cda0, cda1, crr0, crr1, r0, r1 = _KINDS[base]
    heavy = base in ("truck", "semi", "electric_bus")
    electric = base.startswith("electric")
    diesel = base in ("diesel", "van", "truck", "semi")
    tare = u(low, high)
    reference = tare
    radius = u(r0, r1)
    displacement = {
        "small_petrol": u(1.0, 1.25),
        "petrol": u(1.2, 1.8),
        "petrol_dct": u(1.4, 2.0),
        "diesel": u(1.6, 2.2),
        "van": u(2.0, 2.3),
        "truck": u(6.2, 7.8),
        "semi": u(11.0, 13.0),
    }.get(base, 0.0)

    # Engine. Torque by brake mean effective pressure: 10-11.5 bar without a turbo, 18-22 bar with
    # one, 20-24 bar for heavy diesels (Heywood, ch. 2).
    turbo = diesel or base == "petrol_dct" or (base == "petrol" and u() < 0.6)
    bmep = u(9.8, 11.3) if not turbo else u(16.5, 21.0)
    bmep = u(19.0, 22.5) if base in ("truck", "semi") else bmep
    peak = bmep * 1e5 * displacement * 1e-3 / (4.0 * np.pi)
    if base == "small_petrol":
        limit, idle = u(5800, 6300) * RPM, u(700, 850) * RPM
    elif base == "truck":
        limit, idle = u(2300, 2500) * RPM, u(580, 700) * RPM
    elif base == "semi":
        limit, idle = u(1900, 2100) * RPM, u(520, 600) * RPM
    elif diesel:
        limit, idle = u(4300, 4800) * RPM, u(760, 850) * RPM
    else:
        limit, idle = u(6000, 6600) * RPM, u(680, 820) * RPM
    if electric:
        peak = u(220, 400) if base == "electric_car" else u(950, 2100)
        power = u(90e3, 190e3) if base == "electric_car" else u(170e3, 270e3)
        limit = (u(11000, 15000) if base == "electric_car" else u(3000, 3800)) * RPM
        full, top = _motor(peak, power, limit)
        idle = 0.0
    else:
        power = peak * limit * (u(0.68, 0.78) if turbo else 1.0)
        if base in ("truck", "semi"):
            power = peak * limit * u(0.70, 0.80)
        shape = "suction" if not turbo else ("truck" if heavy else "turbo")
        if diesel and not heavy:
            shape = "diesel"
        full, top = _curve(shape, peak, power, limit, rng)
    # Friction: mean pressure 0.97 + 0.15 n + 0.05 n^2 bar, n in 1000 rpm (Heywood, eq. 13.6);
    # diesels about a fifth more. Per N m: pressure times volume over 4 pi.
    per_bar = 1e5 * displacement * 1e-3 / (4.0 * np.pi)
    much = u(0.75, 1.0) * (1.15 if diesel else 1.0)
    n = 1000.0 * RPM
    f0, f1, f2 = 0.97 * per_bar * much, 0.15 * per_bar * much / n, 0.05 * per_bar * much / n**2
    if heavy and not electric:
        f1, f2 = f1 * 1.3, f2 * 1.5
    if electric:
        f0, f1, f2 = 0.004 * peak, 0.006 * peak / limit, 0.006 * peak / limit**2
    kw = 1000.0
    car_regen = u(0.4, 1.6) if base == "electric_car" else u(0.4, 0.9)
    overall = u(7.8, 10.2) if base == "electric_car" else limit * radius / u(24.0, 27.0)
    engine = Engine(
        full=full,
        top=top,
        idle=idle,
        limit=limit,
        friction_0=f0,
        friction_1=f1,
        friction_2=f2,
        pumping=0.0 if electric else (u(0.05, 0.25) if diesel else u(0.3, 0.65)) * per_bar,
        cold=0.0 if electric else u(0.6, 1.3),
        inertia=(
            u(0.03, 0.06) * (1.0 if base == "electric_car" else 12.0)
            if electric
            else displacement * (u(0.19, 0.27) if heavy else u(0.08, 0.13))
        ),
        lag=u(0.03, 0.06) if electric else u(0.07, 0.15),
        boost_share=0.0 if electric or not turbo else u(0.35, 0.5),
        boost_lag_low=u(1.0, 2.2),
        boost_lag_high=u(0.15, 0.35),
        altitude=0.0 if electric else (u(0.1, 0.3) if turbo else 1.0),
        efficiency=u(0.87, 0.92) if electric else (u(0.43, 0.47) if diesel else u(0.36, 0.40)),
        heating=0.0 if electric else 42.7e6,
        regen=car_regen * reference * radius / overall if electric else 0.0,
        regen_power=u(35, 60) * kw if base == "electric_car" else u(90, 140) * kw,
        blend=u(1.5, 2.5) * reference * radius / overall if electric else 0.0,
        blend_power=u(50, 90) * kw if base == "electric_car" else u(130, 200) * kw,
        brake=per_bar * u(7.0, 14.0) if base in ("truck", "semi") else 0.0,
        accessory=u(0.4, 0.9) * kw * (4.0 if heavy else 1.0),
        cycled=(u(8.0, 18.0) if base in ("truck", "semi") else u(1.2, 3.2)) * kw,
        warm_time=u(280, 480) * (1.6 if heavy else 1.0),
        stop_start=int(not heavy and not electric and u() < 0.5),
    )

    # Gearbox. Overall ratios from the speed at 1000 rpm that such vehicles have.
    if base in ("truck", "semi"):
        count = int(rng.choice([6, 8, 12])) if base == "truck" else 12
        last = u(86, 92) / 3.6  # cruising speed, at a good engine speed
        top_ratio = u(1450, 1650) * RPM * radius / last
        top_ratio = u(1150, 1280) * RPM * radius / last if base == "semi" else top_ratio
        spread = {6: u(6.5, 8.0), 8: u(8.0, 10.0), 12: u(11.5, 15.0)}[count]
        ratios = _ratios(top_ratio * spread, top_ratio, count, 0.0)
        kind_box = MANUAL
        robot = 1
    elif electric:
        ratios, kind_box, robot = np.array([overall]), FIXED, 1
    else:
        count = {"small_petrol": 5, "petrol": int(rng.choice([5, 6, 6]))}.get(base, 6)
        kind_box, robot = MANUAL, 0
        if kind == "petrol_dct":
            count, kind_box, robot = int(rng.choice([6, 7])), DUAL_CLUTCH, 1
        if kind in ("petrol_automatic", "diesel"):
            count, kind_box, robot = int(rng.choice([6, 8])), CONVERTER, 1
        per_1000 = {"small_petrol": u(30, 34), "petrol": u(35, 42), "van": u(40, 47)}.get(
            base, u(42, 52)
        )
        top_ratio = 1000.0 * RPM * radius / (per_1000 / 3.6)
        spread = {5: u(3.9, 4.5), 6: u(4.9, 5.9), 7: u(5.8, 6.8), 8: u(6.8, 7.8)}[count]
        ratios = _ratios(top_ratio * spread, top_ratio, count, u(0.25, 0.45))
    if kind == "petrol_cvt":
        spread = u(5.8, 7.5)
        top_ratio = 1000.0 * RPM * radius / (u(44, 56) / 3.6)
        ratios, kind_box, robot = np.geomspace(top_ratio * spread, top_ratio, PLACES), VARIATOR, 1
    mesh = u(0.975, 0.99, ratios.size)
    final = u(0.975, 0.988) if base in ("small_petrol", "petrol", "petrol_dct") else u(0.955, 0.975)
    if electric:
        mesh, final = np.array([u(0.975, 0.988)]), u(0.982, 0.992)
    efficiency = mesh * final
    if heavy and not electric:
        direct = np.argmin(np.abs(ratios - ratios[-1]))
        efficiency[direct] = 0.992 * final  # direct drive
    if kind == "petrol_cvt":
        # Belt and pulleys: best somewhere near the middle, and worse towards one end.
        along = np.log(ratios / np.sqrt(ratios[0] * ratios[-1]))
        efficiency = final * (u(0.92, 0.97) - u(0.01, 0.05) * (along - u(-0.3, 0.3)) ** 2)
    spin = (u(0.02, 0.05), u(0.01, 0.03)) if kind == "petrol_cvt" else None
    box_inertia = 0.012 * peak / 150.0 + 0.01
    shaft = u(6e3, 11e3) if not heavy else u(50e3, 90e3)
    damping = u(0.018, 0.032) * shaft
    start = 1
    if base == "semi":
        start = 3
    elif base == "truck" and ratios.size > 8:
        start = 2
    box = Gearbox(
        kind=kind_box,
        robot=robot,
        ratios=ratios,
        efficiency=efficiency,
        spin_0=(spin[0] if spin else 0.004 if electric else u(0.006, 0.012)) * peak,
        spin_1=(spin[1] if spin else 0.004 if electric else u(0.006, 0.014)) * peak / limit,
        cold=u(0.6, 1.8),
        oil_time=u(900, 1500) * (1.8 if heavy else 1.0),
        inertia=box_inertia,
        capacity=u(1.5, 1.9) * peak,
        open_time=u(0.12, 0.25) if robot else u(0.15, 0.3),
        sync_time=(u(0.25, 0.5) if robot and not heavy else u(0.3, 0.7)),
        close_time=u(0.3, 0.6),
        launch_low=1.08 * idle,
        launch_span=(u(350, 500) if heavy else u(900, 1300)) * RPM,
        converter_k=peak * u(0.75, 0.9) / (u(2200, 2700) * RPM) ** 2,
        converter_ratio=u(1.8, 2.1),
        lock_gear=1 if kind == "petrol_cvt" else int(rng.choice([2, 3])),
        stiffness=shaft,
        damping=damping,
        start_gear=start,
        **_input(kind, idle, limit, rng),
    )

    # Body. Pitch 1 to 3 degrees per g (Gillespie, ch. 7; Milliken); heavy vehicles less.
    degree = np.pi / 180.0
    body = Body(
        reference_mass=reference,
        radius=radius,
        radius_load=u(0.002, 0.006) if not heavy else u(0.004, 0.009),
        wheel_mass=tare * u(0.025, 0.04),
        drag_area=u(cda0, cda1),
        yaw_drag=u(5.0, 12.0) if heavy else u(1.5, 4.0),
        rolling=u(crr0, crr1),
        rolling_speed=u(0.5e-4, 2.5e-4) if not heavy else u(0.3e-4, 1.2e-4),
        tyre_cold=u(0.2, 0.4),
        tyre_time=u(400, 800) if not heavy else u(1500, 2700),
        slip_stiffness=u(14.0, 28.0),
        driven_share={"truck": 0.62, "semi": 0.36, "electric_bus": 0.62, "van": 0.5}.get(
            base, u(0.45, 0.62)
        ),
        corner_stiffness=u(9.0, 13.0),
        wheelbase=u(2.4, 2.8) if not heavy else u(3.7, 6.0),
        squat=(u(0.10, 0.32) if not heavy else u(0.07, 0.25)) * degree,
        dive=(u(0.08, 0.25) if not heavy else u(0.07, 0.22)) * degree,
        # Leaf springs rub, coil springs hardly.
        play=(u(0.02, 0.15) if heavy or base == "van" else u(0.0, 0.03)) * degree,
        pitch_frequency=2.0 * np.pi * u(1.2, 1.9),
        pitch_damping=u(0.22, 0.4),
        heave_frequency=2.0 * np.pi * u(1.1, 1.6),
        heave_damping=u(0.2, 0.35),
        roll_per_accel=u(0.3, 0.7) * degree,
        residual_brake=u(5.0, 45.0) * (4.0 if heavy else 1.0),
        coupled_share=0.0,
        coupled_frequency=1.0,
        coupled_damping=0.2,
    )
    if base == "semi":
        # The trailer behind the play of fifth wheel and bushes: a surge mode of some hertz.
        body = body._replace(
            coupled_share=1.0,
            coupled_frequency=2.0 * np.pi * u(2.5, 4.5),
            coupled_damping=u(0.1, 0.25),
        )
    elif base == "truck" and u() < 0.4:
        # A half-filled tank: the liquid swings at 0.3 to 0.6 Hz.
        body = body._replace(
            coupled_share=u(0.15, 0.4),
            coupled_frequency=2.0 * np.pi * u(0.3, 0.6),
            coupled_damping=u(0.03, 0.1),
        )
    elif base == "van" and u() < 0.3:
        body = body._replace(
            coupled_share=u(0.05, 0.3),
            coupled_frequency=2.0 * np.pi * u(0.5, 3.0),
            coupled_damping=u(0.1, 0.3),
        )

    torque = {"small_petrol": "load", "van": "load", "truck": "percent", "semi": "percent"}.get(
        base, "nm"
    )
    if base == "petrol":
        torque = str(rng.choice(["load", "nm"]))
    elif base == "diesel":
        torque = str(rng.choice(["nm", "percent"]))
    ecu = Ecu(
        torque=torque,
        reference_torque=float(np.ceil(full.max() * 1.02 / 5.0) * 5.0),
        scale=1.0 + 0.009 * float(np.clip(rng.normal(), -2.0, 2.0)),
        part_load=u(-0.05, 0.05) * (0.3 if electric else 1.0),
        map_error=u(0.005, 0.02) * (2.0 if torque == "load" else 1.0) * (0.3 if electric else 1.0),
        map_phase=tuple(u(0.0, 2.0 * np.pi, 4)),
        friction_error=u(0.85, 1.15),
        cold_known=u(0.3, 1.0),
        overrun_load=0.0 if diesel else float(rng.choice([0.0, u(0.03, 0.14)])),
        smoothing=u(0.01, 0.05) if electric else u(0.05, 0.25),
        rotor_fade=u(0.0, 0.025) if electric else 0.0,
        speed_slip=1.0 if heavy else float(rng.choice([0.0, 0.0, 0.5, 1.0])),
        speed_scale=1.0 + 0.008 * rng.normal() + (0.0 if heavy else 0.004),
        speed_growth=u(0.001, 0.004),
        speed_step=1.0 / 256.0 / 3.6 if heavy else (0.01 / 3.6 if torque == "nm" else 1.0 / 3.6),
        speed_floor=bool(u() < 0.5) and torque != "nm",
        rpm_step=0.125 if heavy else (1.0 if electric else 0.25),
        cell_voltage=(
            (u(310, 330), u(385, 400))
            if base == "electric_car"
            else ((u(560, 580), u(690, 720)) if electric else (0.0, 0.0))
        ),
        resistance=u(0.06, 0.12) if electric else 0.0,
    )
    top = {"truck": u(80, 89), "semi": u(80, 89), "van": u(120, 140), "electric_bus": u(70, 80)}
    return Vehicle(
        name=f"{kind}-{seed}",
        kind=kind,
        tare=round(tare),
        gross=round(tare + payload),
        engine=engine,
        box=box,
        body=body,
        ecu=ecu,
        top_speed=top.get(base, u(130, 160)) / 3.6,
        cylinders=0 if electric else (6 if heavy else (3 if displacement < 1.3 else 4)),
    )
