"""What a drive shows of slip and drag area, against what was simulated."""

from dataclasses import replace

import numpy as np
import pytest

import weighbridge as wb
from weighbridge.fleet.facts import row_of
from weighbridge.simulation import FleetSettings, Trailer, plan_fleet, simulate_car
from weighbridge.simulation.fleet import _scenario
from weighbridge.simulation.fleet_files import vehicle_file

BOX = Trailer(kind="box", mass=7000.0, drag_area=1.5, hitch_load=0.0)


def weighed(trailer):
    """A truck of 12 t, with a trailer or alone; its receiver has speeds without noise."""
    _, (day, *_) = plan_fleet(
        FleetSettings(vehicles=1, days=1, drives=1, minutes=12.0, seed=430140)
    )
    made = _scenario(day, 0, day.starts[0], day.vehicle.depot, np.random.default_rng(5))
    made = replace(
        made, payload=12000.0 - made.car.mass, loading=(), trailer=trailer, slip_factor=1.0,
        effects=made.effects.without("gnss_white", "gnss_delay"), wind_speed=0.0,
    )  # fmt: skip
    car = vehicle_file(day.vehicle)
    return made, car, wb.weigh(simulate_car(made).drive, car)


@pytest.fixture(scope="module")
def alone():
    return weighed(None)


@pytest.fixture(scope="module")
def towing():
    return weighed(BOX)


def shown(found, drive=None):
    """What a fleet keeps of a drive, or of it with other signals."""
    return row_of(found if drive is None else replace(found, drive=drive))


def test_slip_is_that_of_the_tyres_and_more_with_a_trailer(alone, towing):
    made, _, found = alone
    one, other = shown(found), shown(towing[2])
    # The weighed mass and the efficiency of the driveline are some percent off.
    assert one["slip"] == pytest.approx(
        made.car.tyre_slip, abs=0.15 * made.car.tyre_slip + 2 * one["slip_std"]
    )
    assert other["slip"] / one["slip"] == pytest.approx(19000.0 / 12000.0, rel=0.2)


def test_a_late_receiver_moves_the_lateness_and_not_the_slip(alone):
    _, _, found = alone
    speed = found.drive.signals["gnss_speed"]
    moved = found.drive.with_signals(replace(speed, time=speed.time + 0.2))
    before, after = shown(found), shown(found, moved)
    assert after["late_s"] - before["late_s"] == pytest.approx(0.2, abs=0.04)
    assert after["slip"] == pytest.approx(before["slip"], abs=0.006)


def test_without_a_receiver_or_with_few_fixes_there_is_no_slip(alone):
    _, _, found = alone
    speed = found.drive.signals["gnss_speed"]
    rest = {n: s for n, s in found.drive.signals.items() if n != "gnss_speed"}
    assert shown(found, replace(found.drive, signals=rest))["slip"] is None
    few = slice(400, 459)  # 59 fixes
    short = replace(speed, time=speed.time[few], values=speed.values[few])
    assert shown(found, found.drive.with_signals(short))["slip"] is None


def test_the_drag_area_of_a_drive_does_not_depend_on_that_of_the_file(alone):
    _, car, found = alone
    load = car.road_load
    other = replace(car, road_load=replace(load, drag_area=load.drag_area + 1.0))
    first, second = shown(found), shown(wb.weigh(found.drive, other))
    assert first["drag_area_m2"] - second["drag_area_m2"] == pytest.approx(1.0, abs=0.1)
    assert second["drag_area_std_m2"] == pytest.approx(first["drag_area_std_m2"], rel=0.1)
    assert first["drag_area_std_m2"] > found.result.slow_errors.constants["drag_area"][1]


def test_the_drag_area_of_a_trailer_shows(alone, towing):
    one, other = (shown(found) for _, _, found in (alone, towing))
    stds = np.hypot(one["drag_area_std_m2"], other["drag_area_std_m2"])
    assert other["drag_area_m2"] - one["drag_area_m2"] == pytest.approx(1.5, abs=2.0 * stds)
    by_rls = wb.weigh(alone[2].drive, alone[1], method="rls")
    assert shown(by_rls)["drag_area_m2"] is None
