"""Speed and recorded torque, no accelerometer: masses of simple drives, and when there is none."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from tests.noted import error

import weighbridge as wb
from weighbridge import ConfigError, Drive, Signal, Vehicle
from weighbridge.balance import Reason
from weighbridge.estimators import ESTIMATORS, speed_torque_ekf
from weighbridge.estimators.speed_samples import covered, sampled, span_means
from weighbridge.vehicle import Driveline, RoadLoad, Timing, TorqueModel

METHOD = "speed-torque-ekf"
MASS = 1400.0
DRAG_AREA, ROLLING, RADIUS, GEARING = 0.65, 0.011, 0.3, 12.0
G, DENSITY = 9.80665, 1.225

CAR = Vehicle(
    name="one gear",
    tare=1250.0,
    driveline=Driveline(
        wheel_radius=RADIUS,
        gearings=(GEARING,),
        efficiency=1.0,
        engine_inertia=0.0,
        wheel_inertia=0.0,
        engine_inertia_std=0.0,
        wheel_inertia_std=0.0,
    ),
    torque=TorqueModel(source="measured", coefficients=(0.0, 1.0), scale_std=0.01),
    road_load=RoadLoad(
        drag_area=DRAG_AREA, drag_area_std=0.02, rolling_coefficient=ROLLING,
        rolling_coefficient_std=0.001,
    ),
    timing=Timing(torque_delay=0.0),
)  # fmt: skip


def drive(
    seed=1,
    *,
    mass=MASS,
    minutes=12.0,
    wave=1.0,
    hills=0.03,
    height=True,
    rate=1.0,
    step=1 / 3.6,
    noise=0.02,
):
    """Accelerations of random sizes over hills; whole km/h, and a torque of 2 % noise."""
    rng = np.random.default_rng(seed)
    dt = 0.05
    time = np.arange(0.0, 60.0 * minutes, dt)
    knots = np.arange(0.0, time[-1] + 12.0, 6.0)
    wanted = 18.0 + wave * rng.normal(scale=5.0, size=knots.size)
    wanted = np.interp(time, knots, np.clip(wanted, 6.0, 35.0))
    kernel = np.exp(-0.5 * (np.arange(-80, 81) * dt / 1.5) ** 2)
    speed = np.convolve(np.pad(wanted, 80, mode="edge"), kernel / kernel.sum(), mode="valid")
    accel = np.gradient(speed, dt)
    distance = np.cumsum(speed) * dt
    grade = hills * np.sin(distance / 150.0)
    altitude = np.cumsum(np.sin(grade) * speed) * dt + 200.0
    force = mass * (accel + G * (np.sin(grade) + ROLLING * np.cos(grade)))
    force = force + 0.5 * DENSITY * DRAG_AREA * speed**2
    torque = force / GEARING
    torque = torque + rng.normal(scale=noise * np.abs(torque).max(), size=torque.size)

    def every(name, values, period, grain=0.0):
        at = slice(None, None, round(period / dt))
        kept = values[at] if grain == 0.0 else np.floor(values[at] / grain) * grain
        return Signal(name, time[at], kept)

    signals = [
        every("vehicle_speed", speed, 1.0 / rate, step),
        every("engine_torque", torque, 0.5),
        every("brake_switch", np.zeros(time.size), 0.5),
    ]
    if height:
        signals.append(every("altitude", altitude + rng.normal(scale=0.5, size=time.size), 1.0))
    return Drive(name=f"drive {seed}", signals={s.name: s for s in signals})


@pytest.fixture(scope="module")
def weighed():
    return wb.weigh(drive(), CAR, METHOD)


def test_known_mass_of_whole_kilometres_per_hour_once_a_second(weighed):
    assert weighed.status == "converged", weighed.reason
    assert weighed.mass == pytest.approx(MASS, rel=0.04)
    low, high = weighed.interval(0.95)
    assert low < MASS < high
    assert weighed.result.balance.motion.source == "speed_grade"


def test_a_load_is_found_and_the_start_is_not_in_the_answer(weighed):
    loaded = wb.weigh(drive(2, mass=MASS + 400.0), CAR, METHOD)
    assert loaded.mass - weighed.mass == pytest.approx(400.0, abs=70.0)
    estimator, balance = ESTIMATORS[METHOD], weighed.result.balance
    ends = [
        estimator.track(balance, CAR, estimator.settings_of({"initial_mass": start})).mass
        for start in (900.0, 2200.0)
    ]
    assert ends == pytest.approx([weighed.mass] * 2, rel=0.005)


def test_without_heights_the_slope_is_a_state_and_the_interval_wider(weighed):
    blind = wb.weigh(drive(height=False), CAR, METHOD)
    assert blind.result.balance.motion.source == "speed"
    assert blind.result.mass == pytest.approx(MASS, rel=0.10)
    assert blind.result.bound_std > 1.5 * weighed.result.bound_std
    untold = wb.weigh(drive(), CAR, METHOD, settings={"measured_grade": False})
    assert untold.result.bound_std > 1.5 * weighed.result.bound_std


def test_an_accelerometer_is_not_read(weighed):
    seen = drive()
    time = np.arange(0.0, seen.duration, 0.1)
    nonsense = Signal("longitudinal_accel", time, np.sin(time) * 3.0)
    other = wb.weigh(replace(seen, signals=seen.signals | {nonsense.name: nonsense}), CAR, METHOD)
    assert other.result.mass == weighed.result.mass


def test_a_cruise_on_the_flat_carries_no_mass():
    calm = wb.weigh(drive(3, wave=0.03, hills=0.0), CAR, METHOD)
    assert calm.status == "not_excited"
    assert np.isnan(calm.mass)


def test_a_minute_carries_no_mass():
    assert wb.weigh(drive(4, minutes=1.0), CAR, METHOD).status != "converged"


def test_a_gap_of_the_speed_and_of_the_torque_is_left_out(weighed):
    whole = drive()
    signals = dict(whole.signals)
    for name, begin, end in (("vehicle_speed", 300.0, 360.0), ("engine_torque", 500.0, 540.0)):
        signal = signals[name]
        kept = (signal.time < begin) | (signal.time > end)
        signals[name] = Signal(name, signal.time[kept], signal.values[kept])
    holed = wb.weigh(replace(whole, signals=signals), CAR, METHOD)
    assert holed.status == "converged"
    assert holed.mass == pytest.approx(weighed.mass, rel=0.03)
    view = holed.result.balance.table
    hidden = (view.time > 305.0) & (view.time < 355.0)
    assert not holed.result.used[hidden].any()
    assert np.isnan(holed.result.residual[hidden]).all()


def test_linearised_at_its_own_acceleration_noise_of_the_torque_makes_it_heavier():
    """As a regressor a noisy force attenuates the inverse mass; the best estimate does not."""
    ends = {}
    for measured in (True, False):
        given = {"measured_jacobian": measured}
        ends[measured] = wb.weigh(drive(noise=0.08), CAR, METHOD, settings=given).result.mass
    assert abs(ends[True] / MASS - 1.0) < 0.03
    assert ends[False] > 1.015 * ends[True]


def test_noise_of_speed_and_of_force_weigh_the_two_accelerations():
    balance = wb.weigh(drive(), CAR, METHOD).result.balance
    settings = speed_torque_ekf.SpeedTorqueSettings()
    _, table = sampled(balance, CAR, 1.0)
    quiet = speed_torque_ekf.parameters(balance, CAR, settings, MASS, np.full(3, -9.0))
    table = table._replace(force_var=np.zeros_like(table.force_var))

    def share(**noise):
        ends = [
            speed_torque_ekf.blended(
                table._replace(accel=table.accel + by), quiet._replace(**noise), MASS
            ).accel
            for by in (0.0, 1.0)
        ]
        return np.nanmedian(ends[1] - ends[0])

    assert share(speed_var=1e-12, slope_var=0.0, accel_density=1.0) == pytest.approx(1.0)
    assert share(speed_var=1.0, slope_var=0.0, accel_density=1e-12) == pytest.approx(0.0, abs=1e-6)
    both = share(speed_var=0.5, slope_var=0.0, accel_density=1.0, gust_speed=1e9)
    assert both == pytest.approx(0.5 / 1.5, rel=0.01)
    known = speed_torque_ekf.blended(table, quiet._replace(slope_var=1.0), MASS, 0.0).accel
    unknown = speed_torque_ekf.blended(table, quiet._replace(slope_var=1.0), MASS).accel
    assert np.nanmax(np.abs(known - unknown)) > 0.05


def test_residual_reason_and_running_mass_are_of_the_rows(weighed):
    track = weighed.result
    n = track.balance.table.time.size
    assert track.running_mass.shape == track.residual.shape == track.row_reason.shape == (n,)
    assert np.isfinite(track.residual[track.used]).all()
    known = track.residual[track.used]
    # 2 % of noise of the torque of one row is 6 % of the weight's 0.1 g; means have less.
    assert np.std(known) < 0.05 * MASS * G
    assert abs(np.mean(known)) < 0.2 * np.std(known)
    assert track.running_mass[-1] == pytest.approx(track.mass, rel=0.02)
    assert set(np.unique(track.row_reason)) <= set(Reason)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"initial_mass": -1.0}, "initial_mass -1.0"),
        ({"sample_time": 60.0}, "sample_time 30 60.0"),
        ({"gate": 0.0}, "gate 0.0"),
        ({"slope_walk": -0.1}, "slope_walk -0.1"),
        ({"measured_grade": 1.0}, "measured_grade 1.0"),
    ],
)
def test_what_cannot_be_set_is_one_sentence(given, said):
    with error(ConfigError, said):
        ESTIMATORS[METHOD].settings_of(given)


def test_stated_noise_is_what_the_interval_is_of():
    stated = {"speed_noise": 0.1, "accel_noise": 0.05, "slope_std": 0.01}
    found = wb.weigh(drive(), CAR, METHOD, settings=stated)
    assert found.mass == pytest.approx(MASS, rel=0.05)
    noisier = wb.weigh(drive(), CAR, METHOD, settings=stated | {"speed_noise": 0.4})
    assert noisier.result.bound_std > 1.2 * found.result.bound_std


def reads_low(seed, mass, **more):
    """A drive whose torque is told 20 % too low."""
    made = drive(seed, mass=mass, **more)
    torque = made.signals["engine_torque"]
    low = Signal(torque.name, torque.time, 0.8 * torque.values)
    return replace(made, signals=made.signals | {low.name: low})


@pytest.fixture(scope="module")
def calibrated():
    """Calibrate on two drives whose torque reads low."""
    return wb.calibrate(
        [reads_low(11, MASS), reads_low(12, MASS + 300.0)],
        [MASS, MASS + 300.0],
        vehicle=replace(CAR, torque=TorqueModel(), road_load=RoadLoad(), timing=Timing()),
        settings=wb.CalibrationSettings(method=METHOD),
    )


@pytest.fixture(scope="module")
def third(calibrated):
    return wb.weigh(reads_low(13, MASS + 150.0), calibrated, METHOD)


def test_calibration_takes_a_constant_bias_out(calibrated, third):
    assert calibrated.provenance.method == METHOD
    assert calibrated.provenance.motion == "speed_grade"
    assert third.status == "converged", third.reason
    assert third.mass == pytest.approx(MASS + 150.0, rel=0.04)
    assert not any(p.id == "vehicle.fitted_for" for p in third.problems)


def test_without_a_calibration_both_jacobians_widen_the_interval():
    """Their masses bound the true one; a calibration takes the bias out."""
    noisy = drive(5, noise=0.08)
    made = replace(CAR, provenance=replace(CAR.provenance, mass_scale_std=0.01))
    known = wb.weigh(noisy, made, METHOD)
    turned = wb.weigh(noisy, made, METHOD, settings={"measured_jacobian": False})
    apart = abs(math.log(turned.result.mass / known.result.mass))
    assert apart > 0.01
    sheet = wb.weigh(noisy, CAR, METHOD)
    # Half of what they are apart is one standard deviation at the least.
    assert 0.5 * apart < sheet.std / sheet.mass
    assert known.std / known.mass < sheet.std / sheet.mass


def test_a_grade_that_is_less_sure_than_in_the_calibration_widens_the_interval(calibrated, third):
    assert 0.0 < calibrated.provenance.unmeasured_grade < 0.015
    blind = wb.weigh(reads_low(13, MASS + 150.0, height=False), calibrated, METHOD)
    assert not any(p.id == "motion.grade_apart" for p in third.problems)
    assert any(p.id == "motion.grade_apart" for p in blind.problems)
    apart = 0.02 - calibrated.provenance.unmeasured_grade
    assert blind.std / blind.mass > apart
    assert abs(blind.mass - (MASS + 150.0)) < 2.0 * blind.std


def test_means_over_spans_are_those_of_the_line_between():
    time = np.array([0.0, 1.0, 3.0, 4.0])
    values = np.array([0.0, 2.0, 2.0, 0.0])
    edges = np.array([0.0, 0.5, 2.0, 3.5])
    fine = np.linspace(0.0, 4.0, 400_001)
    line = np.interp(fine, time, values)
    expected = [line[(fine > a) & (fine <= b)].mean() for a, b in pairwise(edges)]
    np.testing.assert_allclose(span_means(time, values, edges)[1:], expected, rtol=1e-4)


def test_a_span_counts_only_with_all_its_rows():
    time = np.arange(0.0, 10.0, 0.5)
    known = np.ones(time.size, dtype=bool)
    known[8] = False  # 4.0 s: what reaches over it, or begins within its line
    edges = np.arange(0.25, 9.0, 1.0)
    on = covered(time, known, edges)
    assert edges[~on].tolist() == [0.25, 4.25, 5.25]
    gone = (time < 5.0) | (time > 7.6)
    assert not covered(time[gone], known[gone], edges)[6:8].any()
