"""The track beside the signals of its drive: read back by the libraries that viewers use."""

import json
from collections import defaultdict
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as XML

import numpy as np
import pyarrow.parquet as pq
import pytest
from asammdf import MDF
from mcap.reader import make_reader
from mcap.writer import Writer
from scipy.stats import t as student
from tests.unit.test_balance import CAR
from tests.unit.test_weighing import weighing

from weighbridge import Drive, MissingExtraError, Signal, Weighing, read_drive
from weighbridge.io import write_mdf
from weighbridge.signals import QUANTITIES, to_si

GOLDEN = Path(__file__).parents[1] / "golden"


@pytest.fixture(scope="module")
def weighed() -> Weighing:
    """Return a weighing whose drive has clocks of its own, from before zero on."""
    made = weighing(replace(CAR, tare=1400.0))
    speed = made.drive.signals["engine_speed"]
    own = Signal("throttle", speed.time[::3] - 7.3, np.linspace(0.0, 1.0, speed.time[::3].size))
    fixes = Signal("gnss_speed", speed.time[::2] + 0.05, speed.values[::2] / 10.0)
    gear = Signal("gear", speed.time, np.ones(len(speed)))
    return replace(made, drive=made.drive.with_signals(own, fixes, gear))


def compared(drive: Drive, found: dict[str, tuple[np.ndarray, np.ndarray]]) -> None:
    """Compare every signal, stamp by stamp, with what a file has of it, by column."""
    for signal in drive.signals.values():
        quantity = QUANTITIES[signal.name]
        time, values = found[signal.name]
        assert time == pytest.approx(signal.time, abs=2e-9), signal.name
        si = to_si(values, quantity.suffix) if quantity.suffix else values
        assert si == pytest.approx(signal.values, rel=1e-9, abs=1e-12), signal.name
    assert len(found) == len(drive.signals)


def test_the_interval_is_students_and_the_residual_that_of_used_rows(weighed):
    track, result = weighed.track, weighed.result
    half = student.ppf(0.975, result.degrees_of_freedom) * track["std_kg"].to_numpy()
    mass = track["mass_kg"].to_numpy()
    assert track["low95_kg"].to_numpy() == pytest.approx(mass - half, nan_ok=True)
    assert track["high95_kg"].to_numpy() == pytest.approx(mass + half, nan_ok=True)
    kept = track.filter(track["used"])["residual_n"].to_numpy()
    assert kept == pytest.approx(result.residual[result.used])
    assert track.filter(~track["used"])["residual_n"].null_count() == np.sum(~result.used)


def test_mcap(weighed, tmp_path):
    path = tmp_path / "track.mcap"
    weighed.write_track(path)
    zero = np.floor(weighed.drive.start)
    messages = defaultdict(list)
    with path.open("rb") as file:
        for schema, channel, message in make_reader(file).iter_messages():
            assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
            row = json.loads(message.data)
            assert set(row) <= set(json.loads(schema.data)["properties"])
            assert message.log_time == message.publish_time
            assert message.log_time * 1e-9 + zero == pytest.approx(row["time_s"], abs=2e-9)
            messages[channel.topic].append(row)
    track = weighed.track
    assert [row.get("mass_kg") for row in messages["/track"]] == track["mass_kg"].to_list()
    for name in track.columns:
        assert [row.get(name) for row in messages["/track"]] == track[name].to_list()
    found = {}
    for name in weighed.drive.signals:
        quantity = QUANTITIES[name]
        rows = [r for r in messages[f"/drive/{quantity.table}"] if quantity.column in r]
        pairs = [(r["time_s"], r[quantity.column]) for r in rows]
        found[name] = tuple(np.array(pairs).T)
    compared(weighed.drive, found)


def test_mf4(weighed, tmp_path):
    path = tmp_path / "track.mf4"
    weighed.write_track(path)
    clocks = {id(s.time) for s in weighed.drive.signals.values()}
    found = {}
    with MDF(path) as file:
        assert len(file.groups) == len(clocks) + 1
        track = weighed.track
        for name in track.columns[1:]:
            channel = file.get(f"track.{name}")
            assert channel.timestamps == pytest.approx(track["time_s"].to_numpy())
            if name == "reason":
                assert [v.decode() for v in channel.samples] == track[name].to_list()
                continue
            assert channel.samples == pytest.approx(track[name].cast(float).to_numpy(), nan_ok=True)
            suffix = name.rpartition("_")[2]
            assert channel.unit == ("" if name in ("used", "gear") else suffix)
        for name in weighed.drive.signals:
            suffix = QUANTITIES[name].suffix
            channel = file.get(f"{name}_{suffix}" if suffix else name)
            assert channel.unit == suffix
            found[name] = channel.timestamps, channel.samples
    compared(weighed.drive, found)
    # As a drive the file has what the drive had, and nothing of the track.
    assert set(read_drive(path).signals) == set(weighed.drive.signals)


def curves(layout: Path) -> list[str]:
    return [curve.get("name") for curve in XML.parse(layout).iter("curve")]


def test_layouts_of_plotjuggler_name_what_their_files_hold(weighed, tmp_path):
    shown = ("mass_kg", "low95_kg", "high95_kg", "traction_force_n", "residual_n", "speed_mps")
    for suffix, begins, plugin in (
        (".mcap", "/track/", "DataLoad MCAP"),
        (".parquet", "", "DataLoad Parquet"),
    ):
        track = tmp_path / f"a{suffix}"
        weighed.write_track(track)
        layout = tmp_path / f"a{suffix}.plotjuggler.xml"
        assert curves(layout) == [begins + name for name in shown]
        file = XML.parse(layout).find("previouslyLoaded_Datafiles/fileInfo")
        assert file.get("filename") == track.name
        assert file.find("plugin").get("ID") == plugin
    assert set(shown) <= set(pq.read_schema(tmp_path / "a.parquet").names)
    topics = XML.parse(tmp_path / "a.mcap.plotjuggler.xml").find(".//parameters")
    assert set(topics.get("selected_topics").split(";")) == {"/drive/obd", "/drive/gnss", "/track"}
    for suffix in (".csv", ".mf4"):
        weighed.write_track(tmp_path / f"b{suffix}")
        assert not list(tmp_path.glob("b*.xml"))


@pytest.mark.parametrize(("suffix", "package"), [(".mcap", "mcap"), (".mf4", "asammdf")])
def test_a_package_that_is_missing(weighed, tmp_path, monkeypatch, suffix, package):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(MissingExtraError, match=rf"{package}.*weighbridge\["):
        weighed.write_track(tmp_path / f"track{suffix}")
    assert not list(tmp_path.iterdir())


@pytest.fixture
def taken(weighbridge, tmp_path):
    """Return the error of a command that is to write a track; empty where it takes the place."""

    def check(track):
        CAR.save(tmp_path / "car.toml")
        words = ("--vehicle", tmp_path / "car.toml", "--track", track)
        ran = weighbridge("weigh", GOLDEN / "csv", *words)
        return ran.err if ran.code == 2 and "--track" in ran.err else ""

    return check


@pytest.mark.parametrize("suffix", [".mcap", ".mf4"])
def test_the_command_replaces_an_earlier_track_and_no_recording(weighed, taken, tmp_path, suffix):
    track, recording = tmp_path / f"track{suffix}", tmp_path / f"recording{suffix}"
    weighed.write_track(track)
    assert not taken(track)
    if suffix == ".mcap":
        with recording.open("wb") as file:
            writer = Writer(file)
            writer.start(library="a recorder")
            writer.finish()
    else:
        write_mdf(weighed.drive, recording)
    assert recording.name in taken(recording)
    recording.write_bytes(b"")
    assert not taken(recording)


def test_the_command_replaces_no_layout_of_others(weighed, taken, tmp_path):
    track = tmp_path / "track.mcap"
    weighed.write_track(track)
    (tmp_path / "track.mcap.plotjuggler.xml").write_text("<root/>")
    assert "track.mcap.plotjuggler.xml" in taken(track)
