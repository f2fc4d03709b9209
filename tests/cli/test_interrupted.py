"""An interruption ends the command with status 130, without a traceback, and loses nothing."""

import subprocess
import sys

BEGIN = """
import os, signal, sys, threading, time

class Interrupted:
    def find_spec(self, name, path=None, target=None):
        if name == {module!r}:
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(1.0)

def write():
    time.sleep(0.5)
    with open({path!r}, "w") as file:
        file.write("whole")

sys.meta_path.insert(0, Interrupted())
sys.argv = ["weighbridge", "--version"]
threading.Thread(target=write).start()
import runpy
runpy.run_module("weighbridge", run_name="__main__")
"""


def test_an_interruption_while_modules_load_is_quiet_and_waits_for_writers(tmp_path):
    path = tmp_path / "written.txt"
    code = BEGIN.format(module="weighbridge.cli.main", path=str(path))
    ran = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=60.0
    )
    assert ran.returncode == 130, ran.stderr
    assert "Traceback" not in ran.stderr
    assert path.read_text() == "whole"
