"""Files made to break a reader: each one clear sentence and exit status 2, in seconds."""

import os
import resource
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from tests.noted import error, named

from weighbridge import ConfigError, DriveError, Vehicle, read_drive
from weighbridge.io import quietly
from weighbridge.vehicle import Driveline, Mounting, Provenance, RoadLoad, SpeedModel, TorqueModel

GOLDEN = Path(__file__).parent.parent / "golden"

LIMIT_S = 10.0
"""What a refusal may take, on a slow and busy machine."""


@pytest.fixture
def refused(weighbridge, tmp_path):
    """Check that a command ends in one sentence, soon."""

    def check(*words, said=""):
        begun = time.process_time()
        ran = weighbridge(*words)
        assert time.process_time() - begun < LIMIT_S
        assert ran.code == 2, ran.err
        assert ran.err.startswith("weighbridge: ")
        assert ran.err.count("\n") == 1
        assert len(ran.err) < 2100
        assert named(ran.err, said)

    return check


TOMLS = {
    "small": ("tare_kg = 1e-999999999", "from 1e-340 to 1e30"),
    "large": ("tare_kg = 1e999999", "finite"),
    "infinite": ("tare_kg = inf", "finite"),
    "400 digits": ("tare_kg = " + "9" * 400, "below 1e30, got one of 401 digits"),
    "5000 digits": ("tare_kg = " + "9" * 5000, "holds a number that cannot be read"),
    "fraction of 5000 digits": ("tare_kg = 1." + "1" * 5000, "digits"),
    "hexadecimal": ("tare_kg = 0x" + "f" * 5000, "below 1e30"),
    "lists": ("x = " + "[" * 100_000 + "]" * 100_000, "nested too deep"),
    "400 lists": ("tare_kg = " + "[" * 200 + "]" * 200, "must be a number"),
    "tables": ("x = " + "{a=" * 100_000 + "1" + "}" * 100_000, "nested too deep"),
    "dots": ("a." * 100_000 + "b = 1", "a key of more than 100 parts"),
    "quoted dots": ('"a" . ' * 100_000 + "b = 1", "a key of more than 100 parts"),
    "inline dots": ("x = {" + "a." * 100_000 + "b = 1}", "a key of more than 100 parts"),
    "blanks": (lambda: "[" + " " * 1_000_000 + "\n", "not valid TOML"),
    "header": (lambda: "[" + "a" * 3_000_000 + "]\nb = 1", "is not known"),
    "comments": (lambda: "# x\n" * 2_000_000, "longer than 4 MB"),
    "key": (lambda: "a" * 3_000_000 + " = 1", "is not known"),
    "zero": ("tare_kg = 0", "car.toml 2 tare_kg 0.0"),
    "tiny": ("tare_kg = 1e-299", "car.toml tare_kg 1e-299 10 1e+06"),
}


@pytest.mark.parametrize("case", TOMLS)
def test_vehicle_files(refused, tmp_path, case):
    text, said = TOMLS[case]
    path = tmp_path / "car.toml"
    # Texts of megabytes are made where they are written.
    text = text() if callable(text) else text
    path.write_text(f"[vehicle]\n{text}\n")
    refused("weigh", GOLDEN / "csv", "--vehicle", path, said=said)


@pytest.mark.parametrize("text", ["mass_kg = 1e-999999999", "mass_kg = 1" + "0" * 400])
def test_what_is_known_of_a_drive(refused, tmp_path, text):
    folder = Path(shutil.copytree(GOLDEN / "csv", tmp_path / "d"))
    (folder / "drive.toml").write_text(text)
    refused("inspect", folder, said="mass_kg must be")


def test_decorated_comments_and_long_lists_are_no_keys(tmp_path):
    path = tmp_path / "car.toml"
    path.write_text(f"# {'.' * 200}\nx = [{', '.join(['1.5'] * 500)}] # {'. ' * 300}\n")
    # It is read whole: what is refused is its one key.
    with error(ConfigError, "car.toml 2 x"):
        Vehicle.load(path)


@pytest.mark.parametrize(
    ("build", "values"),
    [
        (Driveline, {"wheel_radius": 1e-300}),
        (Driveline, {"wheel_radius": 1e29}),
        (Driveline, {"gearings": (1e20,)}),
        (Driveline, {"engine_inertia": 1e29}),
        (Driveline, {"wheel_inertia_std": 1e29}),
        (Driveline, {"wheel_inertia_std": -1.0}),
        (Driveline, {"idle_speed": 1e20}),
        (Driveline, {"efficiency": 1e-200}),
        (TorqueModel, {"noise": 1e-200}),
        (TorqueModel, {"coefficients": (1e29, 1.0)}),
        (TorqueModel, {"reference_torque": 1e-200}),
        (TorqueModel, {"engine_efficiency": 1e-200}),
        (RoadLoad, {"drag_area_std": 1e29}),
        (Mounting, {"yaw": 1e20}),
        (Mounting, {"squat": 1e20}),
        (Mounting, {"std": (0.0, 1e20, 0.0)}),
        (Provenance, {"masses": (0.0,)}),
        (Vehicle, {"gross": 1e-200}),
        (Vehicle, {"tare": 1e29}),
        (Vehicle, {"mapping": "a\0b"}),
        (
            SpeedModel,
            {
                "mass": 1e-200, "force_gain": 1.0, "drag": 1.0, "rotating_mass": 1.0,
                "corrections": (0.0,) * 7, "scale_std": 1.0,
            },
        ),
    ],
)  # fmt: skip
def test_numbers_that_no_vehicle_has(build, values):
    name = next(iter(values))
    with error(ConfigError, {"gearings": "gearing", "mapping": r"a\x00b"}.get(name, name)):
        build(**values)


@pytest.mark.parametrize(
    ("section", "said"),
    [
        *((f"separator = {s}", "must be one character") for s in
          ('"\\n"', '"\\r"', '"\\u0000"', '"\\""', '"é"', '"🚗"', '"1"', '"."', '";;"', '""')),
        *((f'encoding = "{e}"', "is not a text encoding") for e in
          ("rot13", "base64", "zip", "undefined", "klingon", "a\\u0000b", "x" * 100_000)),
        ("skip_rows = 1" + "0" * 20, "skip_rows must be from 0 to 1000000000"),
        ("skip_rows = 9" + "9" * 400, "skip_rows must be from 0 to 1000000000"),
        ("columns = [" + '"x",' * 20_000 + "]", "columns must be 10000 names at most"),
    ],
)  # fmt: skip
def test_mappings(refused, tmp_path, section, said):
    log, mapping = tmp_path / "x.csv", tmp_path / "m.toml"
    log.write_text("t;v\n1;2\n2;3\n")
    mapping.write_text(
        f"[csv]\n{section}\n[time]\ncolumn = 't'\n[signals.vehicle_speed]\ncolumn = 'v'\n"
    )
    refused("inspect", log, "--mapping", mapping, said=said)


@pytest.mark.parametrize("encoding", ["utf-16", "utf-7", "idna", "unicode_escape", "punycode"])
def test_encodings_that_the_bytes_are_not(weighbridge, tmp_path, encoding):
    log, mapping = tmp_path / "x.csv", tmp_path / "m.toml"
    log.write_bytes("t;v;é\\ud800+2AA-\n1;2;\xff\n2;3;4\n".encode("latin-1"))
    mapping.write_text(
        f"[csv]\nencoding = '{encoding}'\n[time]\ncolumn = 't'\n"
        "[signals.vehicle_speed]\ncolumn = 'v'\nunit = 'kmh'\n"
    )
    ran = weighbridge("inspect", log, "--mapping", mapping)
    assert ran.code in (0, 2)
    if ran.code:
        assert ran.err.count("\n") == 1


def test_a_header_of_ten_million_commas(refused, tmp_path):
    log = tmp_path / "x.csv"
    log.write_bytes(b"," * 10_000_000 + b"\n1,2\n")
    refused("inspect", log, said="10000001")


def test_a_parquet_of_many_columns(tmp_path):
    pl.DataFrame({f"c{k}": [1.0] for k in range(10_001)}).write_parquet(tmp_path / "x.parquet")
    with pytest.raises(DriveError, match="10001 columns"):
        read_drive(tmp_path / "x.parquet")


def test_a_column_name_of_ten_million_letters(weighbridge, tmp_path):
    log = tmp_path / "x.csv"
    rows = "".join(f"\n{k},1,{k}" for k in range(20))
    log.write_text(f"time_s,{'a' * 10_000_000},vehicle_speed_kmh{rows}")
    begun = time.process_time()
    ran = weighbridge("inspect", log)
    assert time.process_time() - begun < LIMIT_S
    assert ran.code == 0
    assert len(ran.out) < 10_000


@pytest.mark.parametrize("kind", ["categorical", "enum", "time as categorical"])
def test_categories_are_the_text_they_stand_for(tmp_path, kind):
    speed = [0.0, 10.5, None, 30.0]
    frame = pl.DataFrame({"time_s": [0.0, 1.0, 2.0, 3.0], "vehicle_speed_kmh": speed})
    column = "time_s" if kind.startswith("time") else "vehicle_speed_kmh"
    text = frame[column].cast(pl.String)
    dtype = pl.Enum(text.drop_nulls().unique()) if kind == "enum" else pl.Categorical()
    frame.with_columns(text.cast(dtype)).write_parquet(tmp_path / "obd.parquet")
    found = read_drive(tmp_path / "obd.parquet").signals["vehicle_speed"]
    assert found.time.tolist() == [0.0, 1.0, 3.0]
    np.testing.assert_allclose(found.values * 3.6, [0.0, 10.5, 30.0])


def test_a_column_of_category_names_is_refused(tmp_path):
    frame = pl.DataFrame({"time_s": [0.0, 1.0], "vehicle_speed_kmh": ["fast", "slow"]})
    frame.with_columns(pl.col("vehicle_speed_kmh").cast(pl.Categorical)).write_parquet(
        tmp_path / "obd.parquet"
    )
    with error(DriveError, "obd.parquet vehicle_speed_kmh fast 1"):
        read_drive(tmp_path / "obd.parquet")


def panic(*_, **__):
    os.write(2, b"thread '<unnamed>' panicked at crates/polars-io/src/csv.rs:1:2:\n")
    raise pl.exceptions.PanicException("index out of bounds: \x1b[31m")


@pytest.mark.parametrize("name", ["obd.csv", "obd.parquet"])
def test_panics_of_the_reading_library(tmp_path, monkeypatch, capfd, name):
    log = tmp_path / name
    shutil.copy(GOLDEN / log.suffix[1:] / name, log)
    monkeypatch.setattr(pl, "read_csv", panic)
    monkeypatch.setattr(pl, "scan_parquet", panic)
    with pytest.raises(DriveError, match="index out of bounds"):
        read_drive(log)
    assert capfd.readouterr().err == ""


def test_standard_error_is_back_after_a_panic(capfd):
    with pytest.raises(ZeroDivisionError), quietly():
        raise ZeroDivisionError
    with quietly(), quietly():
        os.write(2, b"gone")
    os.write(2, b"there")
    assert capfd.readouterr().err == "there"


@pytest.mark.parametrize(
    "words",
    [
        ("inspect", "x" * 300),
        ("inspect", GOLDEN / "csv", "--dbc", "x" * 300),
        ("inspect", GOLDEN / "csv", "--mapping", "x" * 300),
        ("weigh", GOLDEN / "csv", "--vehicle", "x" * 300),
        ("convert", GOLDEN / "csv", "x" * 300),
        ("convert", GOLDEN / "csv", "x" * 296 + ".mf4"),
        ("simulate", "ride", "-o", "x" * 300),
        ("demo", "--no-open", "-o", "x" * 300),
        ("calibrate", GOLDEN / "csv", "--mass", "1500", "-o", "x" * 300),
        ("weigh", GOLDEN / "csv", "--vehicle", "car.toml", "--json", "x" * 300),
    ],
)
def test_names_of_three_hundred_bytes(refused, tmp_path, monkeypatch, words):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "car.toml").write_text("[vehicle]\n")
    refused(*words, said="File name too long")


@pytest.mark.parametrize("option", ["--vehicle", "--mapping", "--dbc"])
def test_folders_and_devices_in_place_of_files(refused, tmp_path, option):
    refused("inspect", GOLDEN / "csv", option, tmp_path, said=tmp_path)
    refused("inspect", GOLDEN / "csv", option, "/dev/zero", said="/dev/zero")
    os.mkfifo(tmp_path / "pipe")
    refused("inspect", GOLDEN / "csv", option, tmp_path / "pipe", said=tmp_path / "pipe")


@pytest.mark.parametrize("name", ["drive.toml", "gnss.csv"])
@pytest.mark.parametrize("what", ["folder", "dangling", "pipe", "device"])
def test_what_is_no_file_in_place_of_a_table(refused, tmp_path, name, what):
    folder = Path(shutil.copytree(GOLDEN / "csv", tmp_path / "d"))
    (folder / name).unlink()
    if what == "folder":
        (folder / name).mkdir()
    elif what == "pipe":
        os.mkfifo(folder / name)
    else:
        (folder / name).symlink_to("/dev/zero" if what == "device" else "nowhere")
    refused("inspect", folder, said=folder / name)


def test_a_mark_of_the_byte_order_is_no_fault(tmp_path):
    (tmp_path / "car.toml").write_bytes(b"\xef\xbb\xbf[vehicle]\r\nname = 'x'\r\n")
    assert Vehicle.load(tmp_path / "car.toml").name == "x"


def test_loops_devices_and_what_is_no_file(refused, tmp_path):
    (tmp_path / "loop").symlink_to("loop")
    (tmp_path / "file").write_text("")
    os.mkfifo(tmp_path / "pipe.csv")
    car = tmp_path / "car.toml"
    car.write_text("[vehicle]\n")
    refused("inspect", tmp_path / "loop", said="symbolic links")
    refused("inspect", tmp_path / "file" / "x", said="Not a directory")
    refused("inspect", tmp_path / "pipe.csv", said=tmp_path / "pipe.csv")
    refused("inspect", "/dev/zero", said="/dev/zero")
    refused("weigh", GOLDEN / "csv", "--vehicle", "/dev/zero", said="/dev/zero")
    refused("vehicle", "show", tmp_path / "pipe.csv", said="pipe.csv")
    words = ("weigh", GOLDEN / "csv", "--vehicle", car, "--json")
    refused(*words, tmp_path / "file" / "x", said=tmp_path / "file" / "x")
    refused("convert", GOLDEN / "csv", tmp_path / "file" / "x", said="Not a directory")
    refused("convert", GOLDEN / "csv", tmp_path / "loop", said=tmp_path / "loop")
    refused("convert", GOLDEN / "csv", tmp_path / "loop", "--force", said="loop")


@pytest.mark.parametrize(
    "body",
    [
        'BO_ 291 M: 8 A\n SG_ s : 0|999999999@1+ (1,0) [0|0] "km/h" A\n',
        'BO_ 291 M: 8 A\n SG_ s : 99999999999|8@1+ (1,0) [0|0] "km/h" A\n',
        'BO_ 291 M: 999999999 A\n SG_ s : 0|8@1+ (1,0) [0|0] "km/h" A\n',
        f'BO_ {"9" * 5000} M: 8 A\n SG_ s : 0|8@1+ (1,0) [0|0] "km/h" A\n',
        f'BO_ 291 M: 8 A\n SG_ s : 0|{"9" * 5000}@1+ (1,0) [0|0] "km/h" A\n',
        'BO_ 1 M: 8 A\n SG_ s : 0|8@1+ (1,0) [0|0] "' + "x" * 300_000,
    ],
)
def test_databases(refused, tmp_path, body):
    dbc = tmp_path / "x.dbc"
    dbc.write_text(f'VERSION ""\nBU_: A\n{body}')
    refused("inspect", GOLDEN / "can.blf", "--dbc", dbc, said="x.dbc")


def limited() -> None:
    """Let files of this process end at 2000 bytes, as a full disk would."""
    resource.setrlimit(resource.RLIMIT_FSIZE, (2000, 2000))


@pytest.mark.parametrize("out", ["old", "new", "old.mf4"])
def test_a_full_disk_loses_nothing(tmp_path, out):
    target = tmp_path / out
    if out == "old":
        shutil.copytree(GOLDEN / "parquet", target)
        (target / "notes.txt").write_text("mine")
    elif out == "old.mf4":
        shutil.copy(GOLDEN / "log.mf4", target)
    before = {p: p.read_bytes() for p in tmp_path.rglob("*") if p.is_file()}
    code = "from weighbridge.cli.main import run; run()"
    words = ["convert", GOLDEN / "csv", target, "--force", "--format", "csv"]
    ran = subprocess.run(
        [sys.executable, "-c", code, *words],
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=limited,
    )
    assert ran.returncode == 2, ran.stderr
    assert "cannot be written: File too large" in ran.stderr
    assert ran.stderr.count("\n") == 1
    assert {p: p.read_bytes() for p in tmp_path.rglob("*") if p.is_file()} == before
    assert sorted(p.name for p in tmp_path.iterdir()) == ([] if out == "new" else [out])


KERNEL = """
import sys
sys.path.insert(0, sys.argv[1])
from weighbridge.kernels import rotation
print(rotation.product(1.0, 0.0, 0.0, 0.0, 0.5, 0.5, 0.5, 0.5))
"""


def test_a_kernel_cache_that_is_cut_off_is_made_again(tmp_path, monkeypatch):
    kept, site = tmp_path / "kernels", tmp_path / "site-packages"
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(kept))
    source = Path(sys.modules["weighbridge"].__file__).parent
    shutil.copytree(source, site / "weighbridge", ignore=shutil.ignore_patterns("__pycache__"))

    def run() -> str:
        ran = subprocess.run(
            [sys.executable, "-c", KERNEL, site], capture_output=True, text=True, check=False
        )
        assert ran.returncode == 0, ran.stderr
        assert ran.stderr == ""
        return ran.stdout

    first = run()
    files = [*kept.rglob("*.nbi"), *kept.rglob("*.nbc")]
    assert len(files) >= 2
    for pattern in ("*.nbi", "*.nbc"):
        for file in kept.rglob(pattern):
            file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
        assert run() == first
    # Made again, it is read again.
    stamps = {f: f.stat().st_mtime_ns for f in kept.rglob("*.nb[ic]")}
    assert run() == first
    assert {f: f.stat().st_mtime_ns for f in kept.rglob("*.nb[ic]")} == stamps
