"""A torque that freezes: what was driven after the next stop has no mass."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import weighbridge as wb
from weighbridge.fleet import read_drives, read_segments, report, speed_mass
from weighbridge.io import write_drive
from weighbridge.simulation import make_scenario, simulate_car

START = "2026-05-04T06:00:00+00:00"


@pytest.fixture(scope="module")
def loading():
    """Fifteen minutes of a car that takes up load in its last stop, and when it drives off."""
    made = make_scenario("car-loading", payload=0.0, seed=3)
    sensors = replace(made.sensors, imu_rate=50.0)
    drive = simulate_car(replace(made, duration=900.0, sensors=sensors)).drive
    stands = drive.speed.time[drive.speed.values < 0.5]
    # It stands at the lights at 374 s, and for its load at 761 s.
    return drive, [float(stands[stands < end].max()) for end in (500.0, 870.0)]


@pytest.fixture(scope="module")
def frozen(tmp_path_factory, loading, short_car, scheduler):
    """Results of the drive with its torque held from an instant on, and what `weigh` says."""

    @cache
    def made(instant):
        home = tmp_path_factory.mktemp("frozen")
        drive = loading[0]
        load = drive.signals["engine_load"]
        held = np.minimum(np.arange(len(load)), np.searchsorted(load.time, instant))
        drive = drive.with_signals(replace(load, values=load.values[held]))
        drive = replace(drive, info=replace(drive.info, start_time=START, mass=None))
        cars, drives = home / "vehicles", home / "drives"
        cars.mkdir()
        replace(short_car, tare=1400.0, gross=2000.0).save(cars / "car.toml")
        write_drive(drive, drives / "car" / "trip", "parquet")
        results = home / "results"
        wb.fleet.weigh_drives(drives, cars, results, scheduler=scheduler)
        told = wb.weigh(drives / "car" / "trip", cars / "car.toml")
        assert told.mass > 0.0
        assert not told.load_changed
        return results, told

    return made


@pytest.mark.parametrize(("instant", "stop"), [(300.0, 0), (450.0, 1)])
def test_from_the_stop_after_the_freeze_on_there_is_no_mass(frozen, loading, instant, stop):
    results, told = frozen(instant)
    segments = read_segments(results).collect()
    first, rest = report(results).legs.sort("leg").to_dicts()
    off = loading[1][stop] - told.drive.start
    assert first["duration_s"] == pytest.approx(off, abs=1.0)
    assert (first["mass_kg"], first["std_kg"]) == (told.mass, told.std)
    assert rest["duration_s"] == pytest.approx(told.drive.duration - off, abs=1.0)
    for name in ("mass_kg", "payload_kg", "overload", "level", "trailer", "empty", "tkm"):
        assert rest[name] is None, name
    assert (rest["prevents"], rest["reason_id"]) == ("mass", "fleet.not_driven_out")
    (row,) = read_drives(results).collect().to_dicts()
    assert first["distance_km"] + rest["distance_km"] == pytest.approx(row["distance_km"])
    assert rest["distance_km"] > 0.3
    assert row["unweighed_s"] == pytest.approx(rest["duration_s"])
    assert segments["weighed_s"].to_list() == pytest.approx([row["used_s"], 0.0], abs=1.0)


def test_what_was_not_weighed_is_in_no_sum_and_is_known_by_no_ticket(frozen, tmp_path):
    results, told = frozen(300.0)
    found = report(results)
    rows = found.legs.sort("leg")
    (vehicle,) = found.vehicles.to_dicts()
    weighed, rest = rows["distance_km"]
    assert (vehicle["drives"], vehicle["legs"]) == (1, 2)
    assert vehicle["known_km"] == vehicle["payload_km"] == pytest.approx(weighed)
    assert vehicle["tkm"] == pytest.approx(1e-3 * (told.mass - 1400.0) * weighed)
    drives, segments = read_drives(results).collect(), read_segments(results).collect()
    table = speed_mass(drives, segments).drop_nulls("speed_kmh")
    assert table.filter(table["mass_t"].is_null())["distance_km"].sum() == pytest.approx(rest)
    tickets = tmp_path / "tickets.csv"
    tickets.write_text(f"vehicle,time,mass_kg\ncar,{rows['end'][1].isoformat()},1786\n")
    late = report(results, tickets=tickets)
    assert (late.totals["known_legs"], late.outside.height) == (0, 0)
    assert late.verdicts["vehicle_id"].to_list() == ["car"]
