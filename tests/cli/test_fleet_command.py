"""The command ``weighbridge fleet``."""

import json
import shutil
import threading
from importlib.util import find_spec

import pytest
from tests.fleet.fleets import tiny_fleet
from tests.noted import named

from weighbridge.fleet.store import Results


@pytest.fixture(scope="module")
def fleet(tmp_path_factory):
    """Folders of six tiny drives and of their vehicle files."""
    return tiny_fleet(tmp_path_factory.mktemp("fleet"), 6)


@pytest.fixture(scope="module")
def address():
    """Address of a scheduler with one worker, a thread of this process."""
    from distributed import LocalCluster

    with LocalCluster(
        n_workers=1,
        threads_per_worker=1,
        processes=False,
        protocol="tcp",
        dashboard_address="127.0.0.1:0",
    ) as cluster:
        yield cluster.scheduler_address


def test_help_has_an_example(weighbridge):
    ran = weighbridge("fleet", "--help")
    assert ran.code == 0
    assert "Example: weighbridge fleet 'drives/**'" in " ".join(ran.out.split())
    assert "Example: weighbridge fleet status" in " ".join(
        weighbridge("fleet", "status", "--help").out.split()
    )


@pytest.mark.parametrize("group", ["fleet", "simulate"])
def test_the_usage_line_is_what_is_typed(weighbridge, group):
    told = weighbridge(group, "--help").out
    assert f"Usage: weighbridge {group} [OPTIONS]" in told


def test_a_run_its_status_and_a_second_run(weighbridge, fleet, address, tmp_path):
    drives, cars = fleet
    results = tmp_path / "results"
    words = (f"{drives}/**", "--vehicles", cars, "-o", results, "--scheduler", address)
    ran = weighbridge("fleet", *words)
    assert (ran.code, ran.err) == (1, "")
    assert "6 recordings weighed" in ran.out
    summary = "6 drives of 3 vehicles: 0 with a mass, 6 missing_signals"
    assert summary in ran.out
    told = weighbridge("fleet", "status", results)
    assert (told.code, told.err) == (0, "")
    assert "no run is under way" in told.out
    assert summary in told.out
    again = weighbridge("fleet", "--vehicles", cars, "-o", results, "--scheduler", address, drives)
    assert "0 recordings weighed" in again.out
    assert "6 were there already" in again.out


def test_the_summaries_name_vehicles_without_a_file_and_copies(weighbridge, address, tmp_path):
    drives, cars = tiny_fleet(tmp_path, 5, 5)
    for k in range(1, 5):
        (cars / f"van{k}.toml").unlink()
    shutil.copytree(drives / "van0" / "trip-0000", drives / "van0" / "copy")
    shutil.copytree(drives / "van0" / "trip-0000", drives / "van1" / "trip")
    results, told = tmp_path / "r", tmp_path / "fleet.json"
    words = (drives, "--vehicles", cars, "-o", results, "--scheduler", address)
    ran = weighbridge("fleet", *words)
    page = tmp_path / "fleet.html"
    shown = weighbridge("fleet", "report", results, "-o", page, "--json", told)
    for out in (ran.out, weighbridge("fleet", "status", results).out, shown.out):
        assert "4 of 5 vehicles without a file" in out
        assert "van1, van2, van3 and 1 more" in out
    assert "1 copy of recordings of the same vehicle" in ran.out
    assert "2 recordings also under another vehicle" in ran.out
    assert "4: van1, van2, van3 and 1 more" in page.read_text()
    without = [f"van{k}" for k in range(1, 5)]
    found = json.loads(told.read_text())
    assert (found["vehicles_without_file"], found["totals"]["without_file"]) == (without, 4)


def test_a_drive_that_cannot_be_read_is_exit_status_2(weighbridge, fleet, address, tmp_path):
    _, cars = fleet
    (tmp_path / "van0").mkdir()
    (tmp_path / "van0" / "obd.csv").write_text("time_s,vehicle_speed_kmh\n")
    words = (tmp_path / "van0", "--vehicles", cars, "-o", tmp_path / "r", "--scheduler", address)
    ran = weighbridge("fleet", *words)
    assert (ran.code, ran.err) == (2, "")
    assert "1 unread" in ran.out
    assert "obd.csv" in ran.out


def test_a_scheduler_without_a_worker_is_told(weighbridge, fleet, tmp_path, monkeypatch):
    from distributed import LocalCluster

    drives, cars = fleet
    results = tmp_path / "results"
    monkeypatch.setattr("weighbridge.cli.fleet._PATIENCE", 0.3)
    with LocalCluster(
        n_workers=0, processes=False, protocol="tcp", dashboard_address="127.0.0.1:0"
    ) as cluster:
        helper = threading.Timer(1.5, cluster.scale, [1])
        helper.start()
        ran = weighbridge("fleet", drives, "--vehicles", cars, "-o", results,
                          "--scheduler", cluster.scheduler_address)  # fmt: skip
        helper.join()
    assert ran.err.count("no worker is connected to the scheduler") == 1
    assert "6 recordings weighed" in ran.out
    opened = Results.opened(results)
    with opened.locked():
        opened.write_progress(opened.read_progress() | {"workers": 0, "done": 0})
        assert "no worker is connected" in weighbridge("fleet", "status", results).out


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("{drives}", "--vehicles", "{cars}", "-o", "{drives}"), "{drives}"),
        (("{drives}/none", "--vehicles", "{cars}", "-o", "{new}"), "{drives}/none"),
        (("{drives}", "--vehicles", "{new}", "-o", "{new}"), "{new}"),
        (("{drives}", "--vehicles", "{cars}", "-o", "{new}", "--class", "boat"), "class must be"),
        (("{drives}", "--vehicles", "{cars}", "-o", "{new}", "--workers", "0"), "1 0"),
        (("{drives}", "--vehicles", "{cars}", "-o", "{new}", "--memory", "lots"), "'1 GB'"),
        (("{drives}", "--vehicles", "{cars}", "-o", "{new}", "--memory", "nan"), "'1 GB'"),
        (("{drives}", "--vehicles", "{cars}", "-o", "{new}", "--memory", "5 kB"), "100 MB 5 kB"),
        *(
            (
                ("{drives}", "--vehicles", "{cars}", "-o", "{new}", "--scheduler", address),
                f"10.0.0.5:8786 {address!r}",
            )
            for address in ("nonsense", "foo://bar:1", "tcp://10.0.0.5:x", "tcp://:1", "")
        ),
        pytest.param(
            ("gs://bucket/drives/**", "--vehicles", "{cars}", "-o", "{new}"),
            "pip install gcsfs",
            marks=pytest.mark.skipif(find_spec("gcsfs") is not None, reason="gcsfs is installed"),
        ),
        (("{drives}", "--vehicles", "{cars}"), "--output"),
        (("status", "{drives}"), "{drives}"),
        (("status",), "results"),
    ],
)
def test_a_mistake_is_one_line(weighbridge, fleet, tmp_path, words, told):
    drives, cars = fleet
    given = {"drives": drives, "cars": cars, "new": tmp_path / "new"}
    ran = weighbridge("fleet", *(word.format(**given) for word in words))
    assert (ran.code, ran.out, ran.err.count("\n")) == (2, "", 1)
    assert named(ran.err, told.format(**given))
    assert not (tmp_path / "new").exists()
