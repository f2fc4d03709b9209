"""The reproduction of Jensen et al. 2022: drives, judging, items, report."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from tests.noted import error

from weighbridge import ConfigError
from weighbridge.calibration import TABLE_5
from weighbridge.estimators import ESTIMATORS, RlsSettings, run_in_turn
from weighbridge.papers import document, jensen2022, seed_of, settings_of
from weighbridge.papers.jensen2022_drives import (
    HIGHWAY_LIMIT,
    HIGHWAY_TRIPS,
    TABLE_B1,
    Conditions,
    gradient_road,
    gradient_scenario,
    highway_scenario,
    scenario,
)
from weighbridge.papers.jensen2022_judged import joined, torques
from weighbridge.papers.jensen2022_reproduction import train
from weighbridge.papers.jensen2022_tables import (
    WEIGHT_UNITS,
    parameters_table,
    passes,
    weights,
)
from weighbridge.simulation import MIDSIZE, make_scenario, simulate_car


@pytest.fixture(scope="module")
def made():
    return simulate_car(make_scenario("car-short", seed=172001))


@pytest.fixture(scope="module")
def car(made):
    return train(made.drive, float(made.truth.mass[0]))


def test_the_conditions_of_a_drive_are_settings():
    tyres, windows = TABLE_B1[10], TABLE_B1[16]
    usual = scenario(tyres, seed=1)
    assert usual.tyre_factor == 1.13
    assert usual.wind_speed == 9.0
    assert usual.effects.warm_up > 0.3
    changed = Conditions(tyre_under=1.4, two_windows=0.1, wind=0.0, cold=0.0)
    other = scenario(tyres, seed=1, conditions=changed)
    assert (other.tyre_factor, other.wind_speed, other.effects.warm_up) == (1.4, 0.0, 0.0)
    assert scenario(windows, seed=1, conditions=changed).drag_area_addition == 0.1
    assert scenario(TABLE_B1[0], seed=1, conditions=changed).tyre_factor == 1.0


def test_highway_trips_lead_north_first_at_the_speeds_of_the_paper():
    for trip in HIGHWAY_TRIPS:
        route = highway_scenario(trip, seed=1).route
        highway = route.limit > HIGHWAY_LIMIT
        out = highway & (np.arange(highway.size) < highway.size // 2)
        assert np.mean(np.cos(route.heading[out])) > 0.85
        assert np.mean(np.cos(route.heading[highway & ~out])) < -0.85
        assert_allclose(np.max(route.limit), trip.fastest, rtol=1e-3)
        assert_allclose(np.min(route.limit[highway]), trip.slowest, rtol=1e-3)
    high, low = (highway_scenario(HIGHWAY_TRIPS[k], seed=1) for k in (0, 3))
    assert high.wind_speed > 5.0 * low.wind_speed
    assert [t.speeds for t in HIGHWAY_TRIPS[:3]] == ["110", "120", "100-120"]


def test_the_road_of_fig_5_is_600_m_with_two_inclines_and_two_right_angles():
    road = gradient_road()
    assert road.length == 600.0
    steep = np.abs(road.grade) > 0.03
    assert np.count_nonzero(np.diff(steep.astype(int)) == 1) == 2
    turned = np.degrees(road.heading)
    assert np.max(turned) - np.min(turned) == pytest.approx(90.0, abs=0.5)
    assert turned[-1] == pytest.approx(0.0, abs=0.5)
    calm, restless = (simulate_car(gradient_scenario(run, 1)).truth for run in (1, 2))
    hardest = [np.max(np.abs(np.gradient(t.speed, t.time))) for t in (calm, restless)]
    assert hardest[1] > 2.0 * hardest[0]


def test_drives_in_turn_are_one_long_drive(car):
    balance = car.balance
    alone = ESTIMATORS["rls"].track(balance, car.vehicle).running_mass
    first, second = run_in_turn([balance, balance], car.vehicle)
    known = np.isfinite(alone)
    assert_allclose(first[known], alone[known], rtol=1e-12)
    # What was learnt is kept: the second begins where the first ended, not at the start value.
    assert second[0] == pytest.approx(first[-1], rel=0.01)
    quick = run_in_turn([balance, balance], car.vehicle, RlsSettings(forgetting=0.99))[1]
    assert np.std(quick) > 2.0 * np.std(second)


def test_torques_are_those_of_the_simulated_engine(made, car):
    mass = float(np.mean(made.truth.mass))
    balance = car.balance
    table = balance.table
    steady = table.usable & (table.accel > 0.0) & np.isfinite(table.gearing)
    found = torques(made.drive, balance, car.vehicle, mass, steady, efficiency=0.33)
    less = torques(made.drive, balance, car.vehicle, mass, steady, efficiency=0.22)
    assert_allclose(less.air, found.air * 2.0 / 3.0)
    true = np.interp(found.time, made.truth.time, made.truth.engine_torque)
    # Less the losses of the driveline, with the engine's inertia still in it.
    assert np.corrcoef(found.motion, true)[0, 1] > 0.93
    assert 0.8 < np.sum(found.motion * true) / np.sum(true**2) < 1.05
    assert 0.85 < found.r_squared < 1.0
    assert 1.0 < found.air_over_source < 1.6
    twice = joined([found, found])
    assert twice.load.size == 2 * found.load.size
    assert twice.r_squared == pytest.approx(found.r_squared)


def test_seeds_are_those_that_no_tuning_saw():
    assert seed_of("jensen2022") == 172_000
    assert seed_of("galvao") == 196_200
    assert seed_of("nguyen2024") == 196_100


def test_what_the_paper_varies_is_a_setting():
    from weighbridge.estimators import changed

    made = changed(
        settings_of("jensen2022")(),
        {
            "rls.forgetting": 0.998,
            "printed.initial_mass": 1200.0,
            "printed.filter.speed_std": 0.3,
            "printed.order": 1,
            "printed.engine_efficiency": 0.3,
            "printed.grid_wheels": [1.0, 4.0, 1.5],
            "conditions.two_windows": 0.1,
            "forgettings": [0.99, 0.999, 1.0],
        },
    )
    assert made.rls.forgetting == 0.998
    assert made.printed.rls.initial_mass == 1200.0
    assert made.printed.filter.noise.speed_std == 0.3
    assert made.printed.order == 1
    assert made.printed.engine_efficiency == 0.3
    assert_allclose(made.printed.axes[3], [1.0, 2.5, 4.0])
    for axis, printed in zip(settings_of("jensen2022")().printed.axes, TABLE_5, strict=True):
        assert_allclose(axis, printed)
    with error(ConfigError, "grid_wheels 1000 4 1.5"):
        changed(made, {"printed.grid_wheels": [4.0, 1.0, 1.5]})
    assert made.conditions.two_windows == 0.1
    with error(ConfigError, "0.9 0.5"):
        replace(made, forgettings=(0.5, 0.9995, 0.9999))


def test_table_6_has_the_truth_and_our_fit_beside_the_printed_ones(car):
    found = car.vehicle
    ours = replace(found, road_load=replace(found.road_load, drag_area=0.5))
    told = np.array([10.0, 50.0, 90.0])
    done = SimpleNamespace(
        printed_car=car,
        control=car,
        car=ours,
        calibration=SimpleNamespace(
            rows=SimpleNamespace(motion_torque=told, source_torque=told + 2.0)
        ),
    )
    table = parameters_table(done)
    rows = {row[0]: row[1:] for row in table.rows}
    assert table.columns[1:] == (
        "paper's car", "paper's rules", "paper's rules, eq. 1 alone", "ours",
        "truly, simulated car",
    )  # fmt: skip
    printed = found.road.drag_area.value
    assert rows["C_d A m²"] == (
        "0.70", f"{printed:.3f}", f"{printed:.3f}", "0.500", f"{MIDSIZE.drag_area:.3f}",
    )  # fmt: skip
    assert rows["I_w kg m²"][-1] == f"{MIDSIZE.wheel_inertia:.1f}"
    # Load in percent: a hundredth of the torque at full load.
    assert float(rows["w1 N m/%"][1]) == pytest.approx(found.torque.coefficients[1] / 100.0, 0.01)
    rpm = math.pi / 30.0
    assert float(rows["w2 N m/rpm"][1]) == pytest.approx(found.torque.coefficients[2] * rpm, 0.01)
    # 2 N m off each, of torques that scatter by 40 N m to both sides.
    assert rows["R², each row counted once"][3] == f"{1.0 - 12.0 / 3200.0:.3f}"
    told_weights = weights(car.vehicle).split(", ")
    assert told_weights[1].endswith(" N m/%")
    assert float(told_weights[1].split()[0]) == float(rows["w1 N m/%"][1])
    # The page of all papers prints what this table has of the paper's car.
    printed = {i.printed for i in jensen2022.ITEMS if i.item == "table 6"}
    assert "near the true ones; of the paper's car 0.70 m², 0.008, 0.14 kg m², 7.0 kg m²" in printed
    assert "-17.85 N m, 9.64 N m/%, 2.5e-3 N m/rpm, -1.44e-6 N m/rpm²" in printed
    assert [rows[f"w{k} {u}"][0] for k, u in enumerate(WEIGHT_UNITS[:4])] == [
        "-17.85", "9.64", "2.5e-3", "-1.44e-6",
    ]  # fmt: skip


def test_the_motorway_is_told_by_direction():
    def drive(running, speed, north):
        table = SimpleNamespace(
            speed=np.array(speed), direction=(np.array(north), np.zeros(len(north))).__getitem__
        )
        return SimpleNamespace(
            balance=SimpleNamespace(table=table),
            track=SimpleNamespace(running_mass=np.array(running)),
            true_mass=1000.0,
        )

    both = drive(
        [np.nan, 900.0, 980.0, 1020.0, 1040.0, 1500.0],
        [30.0, 30.0, 30.0, 30.0, 30.0, 20.0],
        [-1.0, -0.9, -0.8, 0.9, 1.0, 1.0],
    )
    # Nothing is known in the first row, and the last one is no motorway.
    assert passes([both]) == pytest.approx((-6.0, 3.0))
    assert passes([both, drive([1100.0], [30.0], [-1.0])])[0] == pytest.approx(-2.0 / 3.0)


def test_a_control_drive_obeys_equation_1_alone():
    usual = scenario(TABLE_B1[6], seed=1)
    ideal = scenario(TABLE_B1[6], seed=1, conditions=Conditions(ideal=True))
    assert usual.wind_speed > 0.0
    assert ideal.wind_speed == ideal.effects.squat == ideal.effects.obd_delay == 0.0
    assert ideal.mass == usual.mass


def brief(scenario):
    """Drive for less time, with a quarter of the inertial samples, but where eq. 1 acts alone."""
    if scenario.calibration and scenario.effects.squat == 0.0:
        return simulate_car(scenario)
    slow = replace(scenario.sensors, imu_rate=50.0)
    return simulate_car(replace(scenario, sensors=slow, duration=1000.0))


def test_a_reproduction_has_every_figure_and_its_page(tmp_path, monkeypatch):
    monkeypatch.setattr(f"{jensen2022.reproduce.__module__}.simulate_car", brief)
    rows = tuple(r for r in TABLE_B1 if r.number == 7)
    done = jensen2022.reproduce(drives=rows, trips=HIGHWAY_TRIPS[::3])
    made = jensen2022.as_reproduced(done)
    assert "172000 to 172006" in made.note
    assert "no choice of the weighing was made on" in made.note
    assert len(done.gradient) == 3
    assert all(0.0 < r.largest[1] < math.radians(1.5) for r in done.gradient)
    rows = {(r.item, r.what, r.conditions): r for r in made.rows}
    hills = [r.ours for (item, *_), r in rows.items() if item == "fig. 10"]
    assert all(h.startswith("-") and " to +" in h and h.endswith("°") for h in hills)
    assert all(f"{n} m/s: " in rows["fig. 17", "wind in the model", "ours"].ours for n in (3, 6, 9))
    assert rows["fig. 18", "C_d A by ±15 %", "as printed"].ours.startswith("0.85 times: ")
    # Where nothing but eq. 1 acts the grid finds what it can.
    freed = "C_d A, C_r, I_e of a control drive by eq. 1 alone, shifts left out"
    control = rows["table 6", freed, "as printed"]
    assert control.verdict == "agrees"
    assert rows["table 6", "R² of a control drive by eq. 1 alone", "as printed"].verdict == "agrees"
    by_print, ours = done.printed[0], done.drives[0]
    assert 0.003 < by_print.pitch_largest < math.radians(3.0)
    assert ours.pitch_largest < by_print.pitch_largest
    # What was not driven has no figure, and its rows are left out.
    assert not any(r.item == "fig. 11" for r in made.rows)
    text = document([made.section])
    assert "|fig. 19" in text
    page = tmp_path / "page.html"
    made.write_report(page)
    html = page.read_text(encoding="utf-8")
    for number in ("4:", "5,", "8b", "9,", "10,", "12,", "13,", "16,", "17,", "18,", "19,"):
        assert f"Fig. {number}" in html
    assert "fig. 11: these drives were not asked for" in html.lower()
