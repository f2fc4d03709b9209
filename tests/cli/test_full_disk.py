"""Outputs on a read-only or a full disk: one sentence, status 2, and what was there is kept.

The disks are real: a file system in memory, mounted where the command alone sees it.
"""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

INSIDE = ("unshare", "--user", "--map-root-user", "--mount")
COMMAND = f"{sys.executable} -c 'from weighbridge.cli.main import run; run()'"


def mounted(place: Path, size: str, script: str) -> "subprocess.CompletedProcess[str]":
    """Run a script in which a file system of that size is mounted at the place."""
    words = f"mount -t tmpfs -o size={size} tmpfs {place} && {script}"
    return subprocess.run(
        [*INSIDE, "sh", "-c", words], capture_output=True, text=True, check=False, timeout=240
    )


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """Return a folder to mount at; skip where no one may mount."""
    folder = tmp_path_factory.mktemp("disk") / "disk"
    folder.mkdir()
    if shutil.which("unshare") is None or mounted(folder, "64k", "true").returncode != 0:
        pytest.skip("this system lets no one mount a file system of their own")
    return folder


def outputs(drive, car, out):
    return {
        "calibrate": f"calibrate {drive} --mass 1580 --tare 1580 -o {out}/new.toml",
        "json": f"weigh {drive} --vehicle {car} --json {out}/new.json",
        "track": f"weigh {drive} --vehicle {car} --track {out}/new.csv",
        "report": f"weigh {drive} --vehicle {car} --report {out}/new.html",
        "convert": f"convert {drive} {out}/new",
        "simulate": f"simulate car-short -o {out}/new",
    }


@pytest.mark.parametrize("command", ["calibrate", "json", "track", "report", "convert", "simulate"])
def test_a_read_only_disk_is_one_sentence_and_status_2(place, loaded, car, command):
    words = outputs(loaded.folder, car, place)[command]
    script = (
        f"echo kept > {place}/old && mount -o remount,ro {place} && "
        f"{COMMAND} {words}; code=$?; cat {place}/*; exit $code"
    )
    ran = mounted(place, "1m", script)
    assert ran.returncode == 2
    assert ran.stderr.startswith("weighbridge: ")
    assert str(place / "new") in ran.stderr
    assert "Read-only file system" in ran.stderr
    assert ran.stderr.count("\n") == 1
    assert ran.stdout.endswith("kept\n")


@pytest.mark.parametrize("command", ["track", "report", "convert", "simulate"])
def test_a_full_disk_keeps_what_was_there_and_leaves_no_stump(place, loaded, car, command):
    words = outputs(loaded.folder, car, place)[command]
    in_folder = command in ("convert", "simulate")
    whole = "new/x" if in_folder else "x"
    forced = f"{words} --force" if in_folder else words
    script = (
        f"mkdir -p $(dirname {place}/{whole}) && echo kept > {place}/{whole} && "
        f"{COMMAND} {forced}; code=$?; "
        f"cd {place} && find . -type f && cat {whole}; exit $code"
    )
    ran = mounted(place, "64k", script)
    assert ran.returncode == 2
    assert ran.stderr.count("\n") == 1
    assert "No space left on device" in ran.stderr
    assert ran.stdout.splitlines()[-2:] == [f"./{whole}", "kept"]
