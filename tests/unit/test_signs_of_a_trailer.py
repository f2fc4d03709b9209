"""What a drive shows of slip and drag area, against what was simulated."""

from dataclasses import replace

import numpy as np
import pytest

import weighbridge as wb
from weighbridge.balance.wheel_slip import FEWEST, wheel_slip
from weighbridge.estimators.joint.drag_area import shown_drag_area
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


def slip_of(found, drive=None):
    return wheel_slip(found.result.balance.table, found.mass, drive or found.drive)


def test_slip_is_that_of_the_tyres_and_more_with_a_trailer(alone, towing):
    made, _, found = alone
    one, other = slip_of(found), slip_of(towing[2])
    # The weighed mass and the efficiency of the driveline are some percent off.
    assert one.slip == pytest.approx(
        made.car.tyre_slip, abs=0.15 * made.car.tyre_slip + 2 * one.std
    )
    assert other.slip / one.slip == pytest.approx(19000.0 / 12000.0, rel=0.2)


def test_a_late_receiver_moves_the_lateness_and_not_the_slip(alone):
    _, _, found = alone
    speed = found.drive.signals["gnss_speed"]
    moved = found.drive.with_signals(replace(speed, time=speed.time + 0.2))
    before, after = slip_of(found), slip_of(found, moved)
    assert after.late - before.late == pytest.approx(0.2, abs=0.04)
    assert after.slip == pytest.approx(before.slip, abs=0.006)


def test_without_a_receiver_or_with_few_fixes_there_is_no_slip(alone):
    _, _, found = alone
    speed = found.drive.signals["gnss_speed"]
    rest = {n: s for n, s in found.drive.signals.items() if n != "gnss_speed"}
    assert slip_of(found, replace(found.drive, signals=rest)) is None
    few = slice(400, 400 + FEWEST - 1)
    short = replace(speed, time=speed.time[few], values=speed.values[few])
    assert slip_of(found, found.drive.with_signals(short)) is None


def test_the_drag_area_of_a_drive_does_not_depend_on_that_of_the_file(alone):
    _, car, found = alone
    load = car.road_load
    other = replace(car, road_load=replace(load, drag_area=load.drag_area + 1.0))
    first, second = (
        shown_drag_area(found.result),
        shown_drag_area(wb.weigh(found.drive, other).result),
    )
    assert first.value - second.value == pytest.approx(1.0, abs=0.1)
    assert second.std == pytest.approx(first.std, rel=0.1)
    state = [x.slow_errors.constants["drag_area"][1] for x in (found.result,)]
    assert first.std > state[0]


def test_the_drag_area_of_a_trailer_shows(alone, towing):
    one, other = (shown_drag_area(found.result) for _, _, found in (alone, towing))
    assert other.value - one.value == pytest.approx(1.5, abs=2.0 * np.hypot(one.std, other.std))
    assert shown_drag_area(None) is None
    by_rls = wb.weigh(alone[2].drive, alone[1], method="rls").result
    assert shown_drag_area(by_rls) is None
