"""``weighbridge bound`` and ``weighbridge coast``: what speed and grade alone tell, by files."""

import json

import pytest
from tests.graded import AREA, CAR, climb, coasting
from tests.noted import named

from weighbridge.io import write_drive

MASS, POWER = 1400.0, 60.0


@pytest.fixture
def car(tmp_path):
    path = tmp_path / "car.toml"
    CAR.save(path)
    return path


@pytest.fixture
def hill(tmp_path):
    write_drive(climb(MASS, 1e3 * POWER), tmp_path / "hill")
    return tmp_path / "hill"


def test_a_climb_at_full_power_is_bounded(weighbridge, hill, car):
    done = weighbridge("bound", hill, "--vehicle", car, "--power", POWER, "--json", "-")
    assert done.code == 0
    said = json.loads(done.out)
    assert MASS < said["bound_kg"] < 1.3 * MASS
    assert said["nearest_kg"] == pytest.approx(MASS, rel=0.08)
    assert said["status"] == "not_excited"
    assert "mass_kg" not in said


def test_the_bound_is_told_as_no_mass(weighbridge, hill, car):
    done = weighbridge("bound", hill, "--vehicle", car, "--power", POWER)
    assert done.code == 0
    assert "at most" in done.out
    assert "a bound, for nothing shows that the engine gave all of it" in done.out
    wider = weighbridge("bound", hill, "--vehicle", car, "--power", 2 * POWER, "--json", "-")
    narrow = weighbridge("bound", hill, "--vehicle", car, "--power", POWER, "--json", "-")
    assert json.loads(wider.out)["bound_kg"] > 1.7 * json.loads(narrow.out)["bound_kg"]


def test_a_drive_downhill_is_not_bounded(weighbridge, car, tmp_path):
    folder = tmp_path / "down"
    folder.mkdir()
    rows = [f"{t},54,-0.03" for t in range(200)]
    (folder / "obd.csv").write_text(
        "\n".join(["time_s,vehicle_speed_kmh", *(r.rsplit(",", 1)[0] for r in rows)]) + "\n"
    )
    (folder / "gnss.csv").write_text(
        "\n".join(["time_s,grade_rad", *(f"{t},-0.03" for t in range(200))]) + "\n"
    )
    done = weighbridge("bound", folder, "--vehicle", car, "--power", POWER, "--json", "-")
    assert done.code == 1
    assert json.loads(done.out)["bound_kg"] is None


@pytest.mark.parametrize(
    ("words", "told"),
    [(("--power", 0), "0.0"), ((), "--power")],
)
def test_a_power_that_is_none_is_one_line(weighbridge, hill, car, words, told):
    done = weighbridge("bound", hill, "--vehicle", car, *words)
    assert done.code == 2
    assert named(done.err, told)


def test_coasting_both_ways_tells_drag_over_mass(weighbridge, car, tmp_path):
    drive, there, back = coasting(MASS, 3.0)
    folder, written = tmp_path / "run", tmp_path / "coast.json"
    write_drive(drive, folder)
    spans = [
        word
        for option, some in (("--there", there), ("--back", back))
        for a, b in some
        for word in (option, f"{a}:{b}")
    ]
    done = weighbridge("coast", folder, "--vehicle", car, *spans, "--json", written)
    assert done.code == 0
    said = json.loads(written.read_text(encoding="utf-8"))
    low, high = said["drag_over_mass_interval95_m2_per_kg"]
    assert low < AREA / MASS < high
    assert said["drag_over_mass_m2_per_kg"] == pytest.approx(AREA / MASS, rel=0.06)
    low, high = said["rolling_coefficient_interval95"]
    assert low < said["rolling_coefficient"] < high


@pytest.mark.parametrize("span", ["10", "ten:40"])
def test_a_span_that_is_none_is_one_line(weighbridge, hill, span):
    done = weighbridge("coast", hill, "--there", span, "--back", "90:120")
    assert done.code == 2
    assert named(done.err, "--there", span)
