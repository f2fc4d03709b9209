import math
from dataclasses import asdict

import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.unit.made_weighings import weighing

from weighbridge.live.outlook import outlook


def told(mass, std, floor):
    """What JSON and words say of a mass."""
    found = outlook(mass, std, floor, driven=300.0, reason=None, silent=(), first=60.0)
    said = {k: v for k, v in asdict(found).items() if k not in ("status", "reason", "advice")}
    made = weighing(mass=mass, std=std, **said)
    return made.to_dict(), made


@pytest.mark.parametrize(
    ("mass", "std", "floor", "never", "known"),
    [
        (2000.0, 60.0, 0.005, (), (2, 5)),
        (2000.0, 60.0, 0.012, (2,), (5,)),
        (2000.0, 90.0, 0.03, (2, 5), ()),
        (2000.0, 8.0, 0.003, (), (2, 5)),
        (2000.0, math.inf, 0.005, (), ()),
        (math.nan, math.nan, 0.0, (), ()),
    ],
)
def test_never_is_told_from_not_known(mass, std, floor, never, known):
    line, made = told(mass, std, floor)
    for percent in (2, 5):
        minutes, reach = line[f"minutes_to_{percent}_percent"], line["reach_percent"]
        assert (minutes is not None) == (percent in known)
        assert math.isnan(getattr(made, f"minutes_to_{percent}")) == (percent not in never + known)
        assert (minutes is None and reach is not None and reach >= percent) == (percent in never)


@given(st.floats(1.0, 300.0), st.floats(0.0, 0.06), st.floats(60.0, 2700.0))
def test_what_hours_of_driving_leave_is_the_outlook(noise, floor, driven):
    """Whoever drives for the minutes told has the interval; who is told of none has reach left."""
    mass, target = 2000.0, 0.02

    def half(seconds):
        var = noise**2 * driven / (driven + seconds) + (floor * mass) ** 2
        return 1.96 * math.sqrt(var) / mass

    found = outlook(
        mass, math.hypot(noise, floor * mass), floor,
        driven=driven, reason=None, silent=(), first=60.0,
    )  # fmt: skip
    assert found.reach == pytest.approx(half(4.5 * 3600.0), rel=1e-4)
    if math.isinf(found.minutes_to_2):
        assert half(4.5 * 3600.0) > 0.9999 * target
    elif found.minutes_to_2:
        assert found.minutes_to_2 < 270.0
        assert half(60.0 * found.minutes_to_2) == pytest.approx(target, rel=1e-4)


def test_minutes_of_a_mass_that_waits_for_a_look_fall_with_the_driving():
    def minutes(since, wait):
        given = {"driven": 300.0, "reason": None, "silent": (), "first": 60.0}
        return outlook(2000.0, 60.0, 0.005, **given, since=since, wait=wait).minutes_to_2

    at_look = minutes(0.0, 150.0)
    assert at_look > 10.0
    assert minutes(120.0, 30.0) == pytest.approx(at_look - 2.0)
    # The interval is no narrower before the next look, however much was driven.
    assert minutes(60.0 * at_look, 45.0) == pytest.approx(0.75)
    assert minutes(0.0, 60.0 * at_look + 60.0) == pytest.approx(at_look + 1.0)


@pytest.mark.parametrize(
    ("std_found", "part"), [(math.nan, None), (math.inf, 0.0), (0.1 / 1.96, 0.25), (0.01, 1.0)]
)
def test_the_way_to_5_percent_is_that_of_the_last_look_until_there_is_a_mass(std_found, part):
    """Four times the variance that 5 % allows is a quarter of the way."""
    found = outlook(
        math.nan, math.nan, 0.0, driven=20.0, reason=None, silent=(), first=30.0,
        std_found=std_found,
    )  # fmt: skip
    assert found.reason.id == "live.first_mass"
    if part is None:
        assert math.isnan(found.progress_to_5)
    else:
        assert found.progress_to_5 == pytest.approx(part, rel=1e-3)
    weighed = outlook(
        2000.0, 100.0, 0.0, driven=60.0, reason=None, silent=(), first=30.0, std_found=std_found
    )
    assert weighed.progress_to_5 == pytest.approx((0.05 / 0.098) ** 2, rel=1e-3)
