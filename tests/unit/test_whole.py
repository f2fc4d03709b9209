"""Results are written whole or not at all, whatever stops the writer."""

import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from tests.noted import error

from weighbridge import ConfigError, DriveError, read_drive, whole
from weighbridge.io import write_table
from weighbridge.whole import PART, REPLACING, whole_file, whole_folder, write_whole

TABLE = "time_s,vehicle_speed_kmh\n0,{}\n1,20\n2,30\n"


class Stopped(BaseException):
    """Stands for whatever stops a process that can still clean up."""


def names(folder: Path) -> list[str]:
    return sorted(p.name for p in folder.iterdir())


def test_new_and_old_file(tmp_path):
    path = tmp_path / "r.json"
    write_whole(path, "one")
    write_whole(path, "two")
    assert path.read_text() == "two"
    assert names(tmp_path) == ["r.json"]


def test_an_error_while_writing_leaves_the_old_file(tmp_path):
    path = tmp_path / "r.json"
    path.write_text("old")

    def half_written():
        with whole_file(path) as part:
            part.write_text("half of")
            raise Stopped

    with pytest.raises(Stopped):
        half_written()
    assert path.read_text() == "old"
    assert names(tmp_path) == ["r.json"]


@pytest.mark.parametrize("step", ["replace", "fsync"])
def test_an_error_at_the_end_leaves_the_old_file(tmp_path, monkeypatch, step):
    path = tmp_path / "r.json"
    path.write_text("old")

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(*((Path, "replace") if step == "replace" else (os, "fsync")), full)
    with pytest.raises(ConfigError, match=r"r\.json cannot be written: No space left"):
        write_whole(path, "new")
    monkeypatch.undo()
    assert path.read_text() == "old"
    assert names(tmp_path) == ["r.json"]


KILLED = """
import sys, os, signal
from weighbridge.whole import whole_file
with whole_file(sys.argv[1]) as part, part.open("w") as file:
    for k in range(1000):
        file.write("half of a result " * 100)
        file.flush()
        if k == 50:
            os.kill(os.getpid(), signal.SIGKILL)
"""


def test_a_killed_writer_leaves_the_old_file_and_a_named_part(tmp_path):
    path = tmp_path / "imu.csv"
    path.write_text(TABLE.format(10))
    done = subprocess.run([sys.executable, "-c", KILLED, path], check=False)
    assert done.returncode == -signal.SIGKILL
    assert path.read_text() == TABLE.format(10)
    left = [n for n in names(tmp_path) if n != "imu.csv"]
    assert len(left) == 1
    assert left[0].endswith(PART)


def test_links_are_written_through(tmp_path):
    real = tmp_path / "real.json"
    real.write_text("old")
    link = tmp_path / "link.json"
    link.symlink_to("real.json")
    write_whole(link, "new")
    assert link.is_symlink()
    assert real.read_text() == "new"
    dangling = tmp_path / "dangling.json"
    dangling.symlink_to("later.json")
    write_whole(dangling, "new")
    assert (tmp_path / "later.json").read_text() == "new"


def test_a_loop_of_links_is_one_sentence(tmp_path):
    (tmp_path / "a").symlink_to("b")
    (tmp_path / "b").symlink_to("a")
    with pytest.raises(ConfigError, match="a cannot be written"):
        write_whole(tmp_path / "a", "x")


def test_permissions_stay_and_new_files_follow_the_mask(tmp_path):
    kept, new = tmp_path / "kept", tmp_path / "new"
    kept.write_text("old")
    kept.chmod(0o640)
    before = os.umask(0o027)
    try:
        write_whole(kept, "x")
        write_whole(new, "x")
    finally:
        os.umask(before)
    assert kept.stat().st_mode & 0o777 == 0o640
    assert new.stat().st_mode & 0o777 == 0o640


def test_names_as_long_as_the_file_system_allows(tmp_path):
    path = tmp_path / ("x" * 250 + ".json")
    write_whole(path, "x")
    assert path.read_text() == "x"
    with pytest.raises(ConfigError, match="cannot be written: File name too long"):
        write_whole(tmp_path / ("x" * 300), "x")


def test_a_pipe_is_written_to_and_stays(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    got = []
    reader = threading.Thread(target=lambda: got.append(pipe.read_text()))
    reader.start()
    write_whole(pipe, "through")
    reader.join(5.0)
    assert got == ["through"]
    assert pipe.is_fifo()
    assert names(tmp_path) == ["pipe"]


def test_devices_stay():
    write_whole("/dev/null", "x")
    assert Path("/dev/null").is_char_device()
    with pytest.raises(ConfigError, match="/dev/full cannot be written: No space"):
        write_whole("/dev/full", "x")
    assert Path("/dev/full").is_char_device()


def test_standard_output_in_a_file_is_added_to(tmp_path):
    out = tmp_path / "out.txt"
    code = (
        "from weighbridge.whole import write_whole\n"
        "print('before')\nwrite_whole('/dev/stdout', 'whole\\n')\nprint('after')"
    )
    with out.open("wb") as stream:
        subprocess.run([sys.executable, "-c", code], stdout=stream, check=True)
    assert out.read_text() == "before\nwhole\nafter\n"


def test_tables_of_a_full_disk_are_one_sentence():
    column = {"time_s": [float(k) for k in range(20_000)]}
    for suffix in ("csv", "parquet"):
        link = Path(f"/tmp/weighbridge-full-{os.getpid()}.{suffix}")
        link.symlink_to("/dev/full")
        try:
            with pytest.raises(DriveError, match="cannot be written: No space"):
                write_table(column, link)
        finally:
            link.unlink()


def drive(folder: Path, speed: int, suffix: str = "csv") -> Path:
    folder.mkdir(exist_ok=True)
    (folder / f"obd.{suffix}").write_text(TABLE.format(speed))
    return folder


def written(folder: Path, speed: int, stop: BaseException | None = None) -> None:
    files = {
        f"{table}.{suffix}" for table in ("obd", "imu", "gnss") for suffix in ("csv", "parquet")
    }
    with whole_folder(folder, files | {"drive.toml"}) as part:
        (part / "obd.csv").write_text(TABLE.format(speed))
        (part / "drive.toml").write_text("notes = 'new'\n")
        if stop is not None:
            raise stop


def test_a_new_folder_appears_whole(tmp_path):
    with pytest.raises(Stopped):
        written(tmp_path / "d", 10, Stopped())
    assert names(tmp_path) == []
    written(tmp_path / "deep" / "d", 10)
    assert names(tmp_path / "deep") == ["d"]
    assert names(tmp_path / "deep" / "d") == ["drive.toml", "obd.csv"]


def test_a_folder_keeps_what_is_not_the_drive_s(tmp_path):
    folder = drive(tmp_path / "d", 10)
    (folder / "gnss.parquet").write_text("of the old drive")
    (folder / "photo.jpg").write_text("mine")
    (folder / "sub").mkdir()
    written(folder, 50)
    assert names(folder) == ["drive.toml", "obd.csv", "photo.jpg", "sub"]
    assert read_drive(folder).signals["vehicle_speed"].values[0] == pytest.approx(50 / 3.6)


def test_an_error_leaves_the_old_drive(tmp_path):
    folder = drive(tmp_path / "d", 10)
    with pytest.raises(Stopped):
        written(folder, 50, Stopped())
    assert names(folder) == ["obd.csv"]
    assert (folder / "obd.csv").read_text() == TABLE.format(10)


@pytest.mark.parametrize("move", range(3))
def test_an_error_between_the_moves_takes_them_back(tmp_path, monkeypatch, move):
    folder = drive(tmp_path / "d", 10)
    (folder / "gnss.csv").write_text("old")
    before = {p.name: p.read_text() for p in folder.iterdir()}
    real, done = Path.replace, []

    def stopping(self, target):
        if len(done) == move:
            done.append(None)
            raise Stopped
        done.append(target)
        return real(self, target)

    monkeypatch.setattr(Path, "replace", stopping)
    with pytest.raises(Stopped):
        written(folder, 50)
    monkeypatch.undo()
    assert {p.name: p.read_text() for p in folder.iterdir()} == before


SWAP_KILLED = """
import os, signal, sys
from pathlib import Path
from weighbridge.whole import whole_folder
real, left = Path.replace, [int(sys.argv[2])]
def replace(self, target):
    if left[0] == 0:
        os.kill(os.getpid(), signal.SIGKILL)
    left[0] -= 1
    return real(self, target)
Path.replace = replace
with whole_folder(sys.argv[1], {"obd.csv", "imu.csv"}) as part:
    for name in ("obd.csv", "imu.csv"):
        (part / name).write_text("new")
"""


@pytest.mark.parametrize("moves", range(4))
def test_killed_between_the_moves_nothing_is_lost_or_mixed(tmp_path, moves):
    folder = drive(tmp_path / "d", 10)
    (folder / "imu.csv").write_text("old")
    subprocess.run([sys.executable, "-c", SWAP_KILLED, folder, str(moves)], check=False)
    old = {p.read_text() for p in folder.rglob("*.csv")} & {"old", TABLE.format(10)}
    assert old == {"old", TABLE.format(10)}
    assert not {"new"} & old
    with error(DriveError, folder) as found:
        read_drive(folder)
    assert str(folder / REPLACING) in str(found.value)


def test_parts_are_no_drives(tmp_path):
    folder = drive(tmp_path / "d", 10)
    (folder / f".obd.csv-1234{PART}").mkdir()
    (folder / f".obd.csv-1234{PART}" / "part.csv").write_text(TABLE.format(99))
    assert len(read_drive(folder).signals) == 1


def test_a_file_is_no_folder_and_a_folder_no_file(tmp_path):
    (tmp_path / "f").write_text("x")
    with error(ConfigError, tmp_path / "f"):
        written(tmp_path / "f", 1)
    with error(ConfigError, tmp_path):
        write_whole(tmp_path, "x")
    folder = drive(tmp_path / "d", 10)
    (folder / "imu.csv").mkdir()
    (folder / "imu.csv" / "mine").write_text("x")
    with error(ConfigError, folder, "imu.csv"):
        written(folder, 50)
    assert (folder / "imu.csv" / "mine").read_text() == "x"
    assert (folder / "obd.csv").read_text() == TABLE.format(10)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anything")
def test_what_is_protected_is_not_replaced(tmp_path):
    path = tmp_path / "r.json"
    path.write_text("old")
    path.chmod(0o444)
    with pytest.raises(ConfigError, match="Permission denied"):
        write_whole(path, "new")


def test_protection_is_asked_for(tmp_path, monkeypatch):
    path = tmp_path / "r.json"
    path.write_text("old")
    monkeypatch.setattr(whole.os, "access", lambda *_: False)
    with pytest.raises(ConfigError, match="Permission denied"):
        write_whole(path, "new")
    assert path.read_text() == "old"
