"""``weighbridge inspect`` end to end."""

import io
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest
import typer
from tests.noted import error, noted, says
from typer.testing import CliRunner

from weighbridge import DriveError
from weighbridge.cli.inspect import inspect

GOLDEN = Path(__file__).resolve().parents[1] / "golden"


@pytest.fixture
def run():
    app = typer.Typer()
    app.command()(inspect)

    def invoke(*words):
        result = CliRunner().invoke(app, [str(w) for w in words])
        if result.exception is not None and not isinstance(result.exception, SystemExit):
            raise result.exception
        assert result.exit_code == 0
        return result.stdout

    return invoke


def test_canonical_folder(run):
    out = run(GOLDEN / "csv")
    assert "vehicle_speed" in out
    assert "kmh" in out
    assert "IMU with speed and torque in N m" in out


def test_mapping_and_vehicle_file(run, tmp_path):
    car = tmp_path / "car.toml"
    car.write_text(
        f'[vehicle]\nmapping = "{(GOLDEN / "foreign.toml").as_posix()}"\n'
        "[driveline]\ngearings_per_m = [40.0]\n",
        encoding="utf-8",
    )
    out = run(GOLDEN / "foreign.csv", "--vehicle", car)
    assert "longitudinal_accel" in out
    assert "No way to weigh by this drive" in out
    assert "engine_torque" in out


def test_problems_are_listed(run, tmp_path):
    rows = "\n".join(f"{t},{t % 7},-9.81,0" for t in range(200))
    (tmp_path / "imu.csv").write_text(
        f"time_s,accel_x_mps2,accel_y_mps2,[odd]\n{rows}\n", encoding="utf-8"
    )
    out = run(tmp_path)
    assert "serious: imu" in out
    assert "'[odd]'" in out
    # Where the clock cannot be right nothing else is looked at.
    assert not says(out, "range.stuck")
    rows = "\n".join(f"{0.05 * t:.2f},{t % 7},-9.81,0" for t in range(800))
    (tmp_path / "imu.csv").write_text(
        f"time_s,accel_x_mps2,accel_y_mps2,accel_z_mps2\n{rows}\n", encoding="utf-8"
    )
    table = re.sub(r"[\s│]+", " ", run(tmp_path))
    assert says(table, "range.stuck", signal="accel_y", value="-9.81 mps2")


def test_every_way_on_request(run):
    short, long = run(GOLDEN / "csv"), run(GOLDEN / "csv", "--all")
    assert len(re.findall(r"air\s+flow|and air ", long)) >= 4
    assert "air flow" not in short
    assert "lacks" in long
    assert "lacks" not in short


def test_what_cannot_be_read_is_one_error(run, tmp_path):
    with error(DriveError, "nowhere"):
        run(tmp_path / "nowhere")


def test_help_has_an_example(run):
    assert "Example: weighbridge inspect drive/" in run("--help")


def test_one_sample_has_no_rate(run, tmp_path):
    (tmp_path / "obd.csv").write_text(
        "time_s,vehicle_speed_kmh,reference_torque_nm\n0,10,400\n1,11,\n2,12,\n"
    )
    row = next(line for line in run(tmp_path).splitlines() if "reference_torque" in line)
    assert "nan" not in row
    assert row.count("400") == 2


def test_brackets_stay_in_tables_of_several_drives():
    from rich.console import Console

    from weighbridge import Drive, Status, Vehicle
    from weighbridge.cli.weigh import method_table, result_table
    from weighbridge.pipeline.weighing import without_mass

    why = "state it under [torque] of the vehicle file"
    car = Vehicle()
    none = without_mass(Drive("run[a]", {}), car, "rls", noted(why))
    assert none.status is Status.MISSING_SIGNALS
    console = Console(width=160)
    with console.capture() as shown:
        console.print(result_table([none.row], [("logs[b]", noted(why))], car))
        console.print(method_table((none,)))
    text = shown.get()
    assert text.count("under [torque] of") == 3
    assert text.count("run[a]") == 2
    assert "logs[b]" in text


def test_the_next_command_stands_at_the_end(run, weighbridge, loaded, car):
    last = weighbridge("inspect", loaded.folder).out.strip().splitlines()[-1]
    assert last == f"next: weighbridge calibrate {loaded.folder} --mass KG -o vehicle.toml"
    last = weighbridge("inspect", loaded.folder, "--vehicle", car).out.strip().splitlines()[-1]
    assert last == f"next: weighbridge weigh {loaded.folder} --vehicle {car}"


def test_a_narrow_terminal_shows_whole_numbers():
    from rich.console import Console

    from weighbridge import inspect_drive, read_drive
    from weighbridge.cli.inspect import _signal_table

    found = inspect_drive(read_drive(GOLDEN / "csv"))
    for width in (60, 80, 140):
        screen = Console(width=width, record=True, file=io.StringIO())
        screen.print(_signal_table(found, width))
        shown = screen.export_text()
        assert "…" not in shown
        assert ("251" in shown) == (width >= 80)
        assert ("jitter ms" in shown) == (width == 140)


def test_a_log_with_a_retarder_leads_to_a_truck_file():
    from weighbridge import Signal, inspect_drive, read_drive
    from weighbridge.cli.inspect import _Given, _next

    time = np.arange(3.0)
    drive = read_drive(GOLDEN / "csv")
    found = inspect_drive(drive)
    given = _Given(None, None, Path("map.toml"), None, False)
    (only,) = _next(replace(found, problems=()), Path("day"), 1, given)
    assert only == "next: weighbridge calibrate day --mass KG -o vehicle.toml --mapping map.toml"
    truck = drive.with_signals(Signal("retarder_torque", time, -0.1 * time))
    found = replace(found, drive=truck, problems=())
    first, then = _next(found, Path("day"), 1, given)
    assert first.startswith(
        "next: weighbridge vehicle new --class truck --mapping map.toml -o base"
    )
    assert then.startswith("then: weighbridge calibrate day --mass KG -o vehicle.toml")
    assert then.endswith("--vehicle base.toml")


@pytest.fixture
def percent_drive(loaded):
    """A drive of a truck that tells its torque in percent, and nothing else of it."""
    from weighbridge import Signal, read_drive

    drive = read_drive(loaded.folder)
    load = drive.signals["engine_load"]
    drive = drive.without("engine_load", "mass_air_flow", "engine_torque")
    return drive.with_signals(
        Signal("engine_torque_fraction", load.time, load.values),
        Signal("retarder_torque", load.time, 0.0 * load.time),
    )


def next_lines(drive, vehicle=None):
    from weighbridge import inspect_drive
    from weighbridge.cli.inspect import _Given, _next

    found = replace(inspect_drive(drive, vehicle), problems=())
    path = Path("truck.toml") if vehicle is not None else None
    return found, _next(found, Path("day"), 1, _Given(vehicle, path, None, None, False))


def test_percent_torque_without_its_reference_is_what_is_nearest(percent_drive):
    from weighbridge.vehicle.known import Known, describe

    found, (first, then) = next_lines(percent_drive)
    assert found.ways[0].torque == "percent"
    assert found.ways[0].needs == ("reference_torque (or reference_torque_nm in the vehicle file)",)
    assert first.startswith(
        "next: weighbridge vehicle new --class truck --torque percent --reference-torque NM "
        "-o base.toml"
    )
    assert then == "then: weighbridge inspect day --vehicle base.toml"
    truck = describe(Known(kind="truck", torque="percent")).vehicle
    _, (only,) = next_lines(percent_drive, truck)
    assert "reference_torque_nm under [torque] of truck.toml" in only
    truck = describe(Known(kind="truck", torque="percent", reference_torque=1800.0)).vehicle
    found, lines = next_lines(percent_drive, truck)
    assert found.ways[0].chosen
    assert lines[0] == "next: weighbridge weigh day --vehicle truck.toml"


def test_the_torque_in_percent_goes_into_the_next_command(percent_drive):
    from weighbridge import Signal
    from weighbridge.vehicle.known import Known, describe

    reference = Signal("reference_torque", np.array([percent_drive.start]), np.array([1800.0]))
    drive = percent_drive.with_signals(reference)
    _, (first, then) = next_lines(drive)
    assert "vehicle new --class truck --torque percent -o base.toml" in first
    assert then.startswith("then: weighbridge calibrate day")
    # A file that weighs by a torque that the drive lacks leads to no weighing.
    truck = describe(Known(kind="truck", torque="measured")).vehicle
    _, (only,) = next_lines(drive, truck)
    assert only == (
        "next: the vehicle file weighs by torque in N m, and the drive holds torque in percent; "
        "make a vehicle file of it: calibrate --torque percent, or vehicle new --torque percent"
    )


def test_warnings_of_several_drives_are_a_few_lines():
    from weighbridge import Drive, Problem
    from weighbridge.cli.weigh import result_table, warning_lines
    from weighbridge.pipeline.weighing import without_mass
    from weighbridge.vehicle.known import Known, describe

    def day(k, *warnings):
        parted = f"day holds 2 drives, parted by pauses; this is drive {k}"
        name = f"day part {k} of 2"
        told = (Problem("file.part", parted), *map(noted, ("heights", *warnings)))
        return without_mass(Drive(name, {}), truck, "joint", noted("why"), told).row

    truck = describe(Known(kind="truck", torque="percent")).vehicle
    drives = [day(1), day(2, "a", "b", "c", "d", "e")]
    assert warning_lines(drives) == [
        "every drive: heights",
        *(f"day part 2 of 2: {x}" for x in "abc"),
        "day part 2 of 2: 2 more, see --json",
    ]
    assert warning_lines([]) == []
    assert "never calibrated" in result_table(drives, [], truck).title
    assert result_table([], [("day", noted("why"))], truck).title is None


def test_the_way_by_wheel_torque_is_named_where_the_driven_axles_are_all_it_lacks(
    weighbridge, tmp_path
):
    time = np.arange(0.0, 400.0, 0.1)
    speed = 12.0 + 6.0 * np.sin(time / 20.0)
    accel = np.gradient(speed, time) + 9.81 * 0.02 * np.sin(time / 60.0)
    rear = np.round(400.0 * accel)
    table = {"time_s": time, "vehicle_speed_mps": speed, "longitudinal_accel_mps2": accel}
    table |= {"wheel_torque_rl_nm": rear, "wheel_torque_rr_nm": rear}
    pl.DataFrame(table).write_csv(tmp_path / "t.csv")
    ran = weighbridge("inspect", tmp_path / "t.csv")
    text = " ".join(ran.out.split())
    assert "--torque wheel_torque --driven AXLES" in text
    assert "engine_torque" not in text
