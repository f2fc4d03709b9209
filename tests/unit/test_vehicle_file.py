"""Vehicle files: what is saved is loaded again, and mistakes are told with their line."""

import math
import re
import tomllib
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.noted import error

from weighbridge import ConfigError, Vehicle
from weighbridge.vehicle import (
    DraggedReading,
    Driveline,
    Mounting,
    Provenance,
    RoadLoad,
    SecondSignalRelation,
    SpeedModel,
    Timing,
    TorqueModel,
    save_vehicle,
)

positive = st.floats(1e-6, 1e6)
finite = st.floats(-1e9, 1e9)
angle = st.floats(-math.pi, math.pi)
text = st.text(st.characters(exclude_categories=("Cs",), exclude_characters="\r\x00"), max_size=12)
masses = st.floats(10.0, 1e6)


def maybe(strategy):
    return st.none() | strategy


drivelines = st.builds(
    Driveline,
    gearings=st.lists(st.floats(0.01, 1e4), max_size=6).map(
        lambda g: tuple(sorted(g, reverse=True))
    ),
    engine_inertia=st.floats(1e-3, 1e3),
    wheel_inertia=st.floats(1e-3, 1e4),
    wheel_radius=st.floats(0.05, 3.0),
    efficiency=st.floats(0.05, 1.0),
    speed_scale=st.floats(0.8, 1.2),
    idle_speed=st.floats(0.0, 200.0),
)
rising = st.lists(st.floats(1.0, 900.0), min_size=1, max_size=5, unique=True).map(
    lambda x: tuple(sorted(x))
)


def curve(x_name, y_name):
    """Fields of a curve: as many of both, and the first rises."""
    return rising.flatmap(
        lambda x: st.tuples(*[finite] * len(x)).map(lambda y: {x_name: x, y_name: y})
    )


pairs = st.tuples(st.floats(0.0, 500.0), st.floats(0.0, 500.0)).map(lambda p: tuple(sorted(p)))
torques = st.builds(
    TorqueModel,
    source=st.just("load"),
    coefficients=st.lists(finite, min_size=2, max_size=5).map(tuple),
    reference_torque=maybe(st.floats(1.0, 1e6)),
    engine_efficiency=st.floats(0.01, 1.0),
    noise=maybe(positive),
    scale_std=maybe(st.floats(0.0, 10.0)),
    load_range=maybe(pairs),
    speed_range=maybe(pairs),
)
bent = st.tuples(torques, curve("knots", "knot_slopes")).map(lambda t: replace(t[0], **t[1]))
dragged = st.tuples(curve("engine_speed", "level"), positive, positive, st.floats(0.0, 1e6)).map(
    lambda d: DraggedReading(**d[0], scatter=d[1], span=d[2], reach=d[3])
)
rising = st.tuples(st.floats(-1e8, 0.0), st.floats(0.1, 1e8))
witness_fields = {
    "scatter": positive,
    "span": positive,
    "scale_std": positive,
    "value_range": rising,
    "speed_range": st.tuples(st.floats(0.0, 10.0), st.floats(20.0, 1e4)),
    "lag": maybe(st.floats(-60.0, 60.0)),
    "pressure": maybe(st.floats(1e4, 2e5)),
    "temperature": maybe(st.floats(150.0, 400.0)),
}
WITNESS_TERMS = {
    "mass_air_flow": 4,
    "absolute_load": 4,
    "intake_pressure": 4,
    "fuel_rate": 4,
    "engine_load": 4,
    "demanded_torque": 4,
    "battery_current": 3,
}
witnesses = st.sets(st.sampled_from(sorted(WITNESS_TERMS)), max_size=3).flatmap(
    lambda names: st.tuples(
        *(
            st.builds(
                SecondSignalRelation,
                signal=st.just(name),
                coefficients=st.tuples(*[finite] * many),
                **witness_fields,
            )
            for name, many in WITNESS_TERMS.items()
            if name in names
        )
    )
)
speed_models = st.builds(
    SpeedModel,
    mass=masses,
    sample_time=st.floats(1.0, 60.0),
    force_gain=positive,
    drag=st.floats(0.0, 1e3),
    rolling_coefficient=st.floats(0.0, 0.099),
    rotating_mass=st.floats(0.0, 1e6),
    corrections=st.tuples(*[finite] * 7),
    r_squared=maybe(st.floats(0.0, 1.0)),
    samples=maybe(st.integers(0, 10_000)),
    scale_std=st.floats(1e-3, 1e3),
)
vehicles = st.builds(
    Vehicle,
    name=text,
    kind=st.sampled_from(["car", "van", "bus", "truck"]),
    tare=maybe(masses),
    gross=maybe(masses),
    mapping=maybe(st.text("aZ0 ./_-äß雪", max_size=12)),
    driveline=drivelines,
    torque=torques | bent,
    road_load=st.builds(
        RoadLoad,
        drag_area=st.floats(0.0, 19.0),
        rolling_coefficient=st.floats(0.0, 0.09),
        rolling_speed_coefficient=st.floats(0.0, 0.001),
    ),
    mounting=maybe(
        st.builds(
            Mounting,
            roll=angle,
            pitch=angle,
            yaw=angle,
            std=maybe(st.tuples(*[st.floats(0.0, 3.0)] * 3)),
            squat=maybe(st.floats(-0.1, 0.1)),
            squat_std=maybe(st.floats(0.0, 1.0)),
        )
    ),
    timing=st.builds(
        Timing,
        torque_delay=maybe(st.floats(-1.0, 3.0)),
        torque_delay_std=maybe(st.floats(0.0, 1e3)),
    ),
    dragged=maybe(dragged),
    witnesses=witnesses,
    speed_model=maybe(speed_models),
    provenance=st.builds(
        Provenance,
        drives=st.lists(text, max_size=3).map(tuple),
        date=maybe(st.dates().map(str)),
        r_squared=maybe(st.floats(0.0, 1.0)),
        residual_std=maybe(positive),
        samples=maybe(st.integers(0, 10**9)),
        mass_scale_std=maybe(st.floats(0.0, 1e3)),
        std_factor=maybe(st.floats(0.1, 100.0)),
        highest_torque=maybe(positive),
        torque_use=st.sampled_from(((), (0.0, -0.25, 3e-7))),
        fit_cov=st.sampled_from(((), (2.0,), (1.5, -0.25, 3e-7))),
        notes=maybe(text),
    ),
)


@settings(max_examples=60, deadline=None)
@given(vehicles)
def test_saved_vehicle_is_loaded_to_the_last_bit(tmp_path_factory, vehicle):
    path = tmp_path_factory.mktemp("vehicle") / "car.toml"
    save_vehicle(vehicle, path, exact=True)
    assert Vehicle.load(path) == vehicle


def test_numbers_are_rounded_to_their_uncertainty(tmp_path):
    correlated = np.array([[4.0, 1.9999999, 0.0], [1.9999999, 1.0, 0.0], [0.0, 0.0, 0.0]])
    car = Vehicle(
        tare=1580.123456789,
        driveline=Driveline(
            gearings=(28.123456789, 11.0),
            gearing_stds=(0.0123456, 0.001),
            engine_inertia=1.0 / 3.0,
            engine_inertia_std=0.0,
        ),
        torque=TorqueModel(
            source="measured",
            coefficients=(-3.987654321, 1.0123456789),
            coefficient_stds=(2.345678, 0.00123456),
        ),
        mounting=Mounting(
            roll=math.radians(1.23456789), std=(math.radians(0.02),) * 3, squat=math.radians(0.2)
        ),
        witnesses=(
            SecondSignalRelation(
                signal="mass_air_flow",
                coefficients=(1.0 / 3.0, 0.0, 2.0, 1e-9 / 3.0),
                scatter=0.01,
                span=0.5,
                scale_std=0.03,
                value_range=(0.1, 1.0),
                speed_range=(100.0, 400.0),
            ),
        ),
        provenance=Provenance(notes="n", fit_cov=tuple(correlated[np.tril_indices(3)])),
    )
    path = tmp_path / "car.toml"
    car.save(path)
    text = path.read_text(encoding="utf-8")
    data = tomllib.loads(text)
    assert data["vehicle"]["tare_kg"] == 1580.123456789
    assert data["driveline"]["gearings_per_m"] == [28.12346, 11.0]
    assert data["driveline"]["gearing_stds_per_m"] == [0.01235, 0.001]
    assert data["driveline"]["engine_inertia_kgm2"] == 0.333333
    assert data["torque"]["coefficients"] == [-3.988, 1.012346]
    assert data["mounting"]["roll_deg"] == 1.23457
    assert data["mounting"]["squat_deg_per_mps2"] == 0.2
    # The covariance is one block at the end, and stays one.
    keys = [line.split(" = ")[0] for line in text.splitlines() if " = " in line]
    assert keys[-1] == "fit_cov"
    loaded = Vehicle.load(path)
    again = np.zeros((3, 3))
    again[np.tril_indices(3)] = loaded.provenance.fit_cov
    again += np.tril(again, -1).T
    assert np.linalg.eigvalsh(again[:2, :2])[0] > 0.0
    assert again[0, 1] == pytest.approx(1.9999999, rel=1e-9)
    # Once rounded, it is written as it is.
    loaded.save(tmp_path / "again.toml")
    assert (tmp_path / "again.toml").read_text(encoding="utf-8") == text


def test_a_covariance_with_a_known_combination_is_rounded_and_keeps_it(tmp_path):
    """The scale of every mass is taken out of it, which leaves it singular."""
    rng = np.random.default_rng(5)
    parts = rng.normal(size=(6, 6)) * np.array([1.0, 1e-2, 1e-3, 0.3, 1e-3, 2.0])
    known = rng.normal(size=6)
    whole = parts.T @ parts
    cov = whole - np.outer(whole @ known, whole @ known) / (known @ whole @ known)
    rows, path = np.tril_indices(6), tmp_path / "car.toml"
    Vehicle(provenance=Provenance(fit_cov=tuple(cov[rows]))).save(path)
    texts = re.findall(r"[-+.\de]+", path.read_text(encoding="utf-8").partition("fit_cov = ")[2])
    assert max(len(t.strip("-0.").replace(".", "")) for t in texts) <= 9
    again = np.zeros((6, 6))
    again[rows] = Vehicle.load(path).provenance.fit_cov
    again += np.tril(again, -1).T
    apart = np.sum((known * np.sqrt(np.diag(cov))) ** 2)
    assert abs(known @ again @ known) < 1e-7 * apart


def test_file_speaks_the_units_of_people(tmp_path):
    path = tmp_path / "car.toml"
    save_vehicle(
        Vehicle(
            name="test",
            tare=1580.0,
            driveline=Driveline(gearings=(28.85,), idle_speed=800 * math.pi / 30),
            torque=TorqueModel(source="measured", load_range=(0.05, 0.35)),
            mounting=Mounting(roll=math.radians(2.0)),
        ),
        path,
    )
    data = tomllib.loads(path.read_text(encoding="utf-8"))
    assert data["vehicle"]["tare_kg"] == 1580.0
    assert data["driveline"]["idle_speed_rpm"] == pytest.approx(800.0, rel=1e-14)
    assert data["torque"]["load_range_pct"] == [5.0, 35.0]
    assert data["mounting"]["roll_deg"] == pytest.approx(2.0, rel=1e-14)
    assert data["provenance"]["format_version"] == 1
    # Every key is explained.
    assert path.read_text(encoding="utf-8").count("#") > 15


def load(tmp_path, content):
    path = tmp_path / "car.toml"
    path.write_text(content, encoding="utf-8")
    return Vehicle.load(path)


def test_data_sheet_values_are_accepted(tmp_path):
    car = load(
        tmp_path,
        """
        [vehicle]
        class = "van"
        tare_t = 2.1

        [driveline]
        gear_ratios = [3.8, 2.0]
        final_drive = 4.0
        wheel_radius_m = 0.32

        [road_load]
        drag_coefficient = 0.30
        frontal_area_m2 = 2.5

        [timing]
        torque_delay_ms = 120
        """,
    )
    assert car.kind == "van"
    assert car.tare == 2100.0
    assert car.driveline.gearings == pytest.approx((3.8 * 4.0 / 0.32, 2.0 * 4.0 / 0.32))
    assert car.road_load.drag_area == pytest.approx(0.75)
    assert car.timing.torque_delay == 0.12


def test_empty_file_is_a_vehicle_of_defaults(tmp_path):
    assert load(tmp_path, "") == Vehicle()


@pytest.mark.parametrize(
    ("text", "engine", "wheels"),
    [
        ("[driveline]\ngearings_per_m = [30.0]\n", 0.045, 5.0),
        ('[vehicle]\nclass = "truck"\n', 2.5, 110.0),
        ('[vehicle]\nclass = "truck"\n[driveline]\nengine_inertia_kgm2 = 1.5\n', 1.5, 110.0),
        ("[driveline]\nengine_inertia_kgm2 = 0.15\nwheel_inertia_kgm2 = 6.0\n", 0.15, 6.0),
    ],
)
def test_inertias_left_out_are_those_of_the_class(tmp_path, text, engine, wheels):
    road = load(tmp_path, text).road
    assert (road.engine_inertia.value, road.wheel_inertia.value) == (engine, wheels)


SPEED_MODEL = """[speed_model]
mass_kg = 1092
force_gain_per_m = 20
drag_kg_per_m = 0.9
rotating_mass_kg = 71
scale_std = 0.2"""


WITNESS = """[witnesses.mass_air_flow]
scatter = 0.01
span = 0.5
scale_std = 0.03
value_range = [0.1, 1.0]
speed_range_rpm = [900, 4000]"""


DRAGGED = "[dragged]\nengine_speed_rpm = [900, 2000]\nscatter = 0.01\nspan = 0.8"


def test_all_mistakes_are_told_at_once(tmp_path):
    path = tmp_path / "car.toml"
    path.write_text(
        '[vehicle]\nclas = "car"\n[driveline]\nwheel_radius = 0.3\ngear_ratios = [3.0, 2.0]\n'
        '[road_load]\ndrag_area_m2 = "x"\nfoo = 1\n[mountin]\na = 1\n'
    )
    with pytest.raises(ConfigError) as told:
        Vehicle.load(path)
    lines = [int(n) for n in re.findall(r"line (\d+)", str(told.value))]
    assert sorted(lines) == [2, 4, 7, 8, 9]


@pytest.mark.parametrize(
    ("content", "line", "values"),
    [
        ("[vehicle]\ntara_kg = 1500", 2, "tara_kg tare_kg"),
        ("[vehicle]\ntare = 1500", 2, "tare tare_kg"),
        ("[vehicle]\ntare_m = 1500", 2, "tare_m"),
        ("[vehicle]\ntare_kg = -3", 2, "tare_kg -3"),
        ("[vehicle]\ntare_kg = nan", 2, "tare_kg NaN"),
        ("[vehicle]\ntare_kg = '1500'", 2, "tare_kg 1500"),
        ("[vehicle]\ntare_kg = 1500\ntare_t = 1.5", 3, "tare_t tare_kg"),
        ("[vehicle]\nclass = 'boat'", 2, "boat truck"),
        ("[vehicle]\nname = 3", 2, 'name 3 "'),
        ("\n[driveline]\n\nefficiency = 1.2", 4, "efficiency 1.2"),
        ("[driveline]\ngearings_per_m = [10, 20]", 2, "gearings_per_m 10 20"),
        ("[driveline]\ngearings_per_m = 10", 2, "gearings_per_m 10"),
        ("[driveline]\ngear_ratios = [3, 2]", 2, "gear_ratios wheel_radius_m"),
        ("[driveline]\nfinal_drive = 4.0", 2, "final_drive gear_ratios"),
        ("[driveline]\ngear_ratios = [1, 2]\nwheel_radius_m = 0.3", 2, "gear_ratios 1.0 2.0"),
        ("[driveline]\nspeed_scale = 2", 2, "speed_scale 2"),
        ("[torque]\nsource = 'magic'", 2, "magic air_flow battery"),
        ("[torque]\nsource = 'load'\ncoefficients = [1.0]", 3, "torque.coefficients load 1.0"),
        ("[torque]\nload_range_pct = [50, 10]", 2, "load_range_pct"),
        ("[road_load]\ndrag_coefficient = 0.3", 2, "drag_coefficient frontal_area_m2"),
        ("[road_load]\nrolling_coefficient = 0.9", 2, "rolling_coefficient 0.9"),
        (
            "[road_load]\nrolling_speed_coefficient_s_per_m = 0.9",
            2,
            "rolling_speed_coefficient_s_per_m 0.9",
        ),
        ("[mounting]\nstd_deg = [1, 2]", 2, "std_deg 2"),
        ("[timing]\ntorque_delay_s = 120", 2, "torque_delay_s 120"),
        (DRAGGED + "\nlevel = [0.1]", 2, "level engine_speed 2 1"),
        (DRAGGED + "\nlevel = []", 5, "dragged.level []"),
        (DRAGGED.replace("2000", "700") + "\nlevel = [1, 2]", 2, "engine_speed_rpm 900 700"),
        ("[dragged]\nspan = 1.0", 1, "dragged"),
        (WITNESS, 1, "mass_air_flow coefficients"),
        (WITNESS + "\ncoefficients = [1, 2]", 7, "mass_air_flow.coefficients 4 2"),
        (WITNESS + "\ncoefficients = [0, 1, 0, 0]\nlag = 1", 8, "lag lag_s"),
        (WITNESS.replace("0.1, 1.0", "1.0, 0.1"), 5, "value_range"),
        (WITNESS.replace("air_flow", "air_flwo"), 1, "mass_air_flwo mass_air_flow"),
        ("[provenance]\nformat_version = 99", 2, "format_version 99 1"),
        ("[provenance]\nsamples = 1.5", 2, "samples 1.5"),
        ("[speed_model]\nmass_kg = 1092", 1, "speed_model force_gain_per_m drag_kg_per_m"),
        (SPEED_MODEL + "\ncorrections = [1, 2]", 7, "corrections p1 p7 2"),
        ("[roadload]\n", 1, "roadload road_load"),
        ("vehicle = 3", 1, "vehicle"),
    ],
)
def test_mistakes_are_told_with_file_line_and_remedy(tmp_path, content, line, values):
    with error(ConfigError, "car.toml", line, values):
        load(tmp_path, content)


def test_broken_toml_is_told(tmp_path):
    with pytest.raises(ConfigError, match=r"car\.toml is not valid TOML.*line 1"):
        load(tmp_path, "[vehicle\nname = 'x'")


def test_missing_file_is_told(tmp_path):
    with pytest.raises(ConfigError, match=r"nowhere\.toml: no such file"):
        Vehicle.load(tmp_path / "nowhere.toml")


def test_unwritable_place_is_told(tmp_path):
    with pytest.raises(ConfigError, match="cannot be written"):
        save_vehicle(Vehicle(), tmp_path / "no" / "such" / "folder.toml")


def test_numbers_of_a_list_are_shown_as_they_were_written(tmp_path):
    with pytest.raises(ConfigError) as caught:
        load(tmp_path, "[torque]\nsource = 'load'\ncoefficients = [303.181]")
    assert "Decimal" not in str(caught.value)
    assert "[303.181]" in str(caught.value)
