"""Nothing is ever sent: no network module in the code, no connection while commands run."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import weighbridge

GOLDEN = Path(__file__).parent.parent / "golden"
SOURCE = Path(weighbridge.__file__).parent

NETWORK = {
    "aiohttp", "asyncio", "ftplib", "http", "httpx", "imaplib", "poplib", "requests", "smtplib",
    "socket", "socketserver", "ssl", "telnetlib", "urllib", "urllib3", "websockets", "xmlrpc",
}  # fmt: skip

IMPORT = re.compile(r"^\s*(?:from\s+([\w.]+)\s+import|import\s+(.+))", re.MULTILINE)

FORBIDDING = """
import os, sys
def forbid(event, arguments):
    name = event.partition(".")[0]
    if name in ("socket", "urllib", "http", "ftplib", "smtplib", "poplib", "imaplib", "ssl"):
        os.write(2, f"NETWORK {event}\\n".encode())
        os._exit(99)
    if event in ("os.system", "os.exec", "os.posix_spawn", "subprocess.Popen"):
        os.write(2, f"PROGRAM {arguments}\\n".encode())
        os._exit(98)
"""

RUN = """
import json
from weighbridge.cli.main import run
sys.addaudithook(forbid)
codes = []
for words in json.loads(sys.argv[1]):
    sys.argv[1:] = words
    try:
        run()
        codes.append(0)
    except SystemExit as leaving:
        codes.append(leaving.code or 0)
print(codes)
"""


def test_no_module_of_ours_knows_the_network():
    # Live samples may come over a network, emulated devices stand in for that, and the workers of a
    # fleet may be elsewhere; the page of `live` listens; nothing else.
    live = SOURCE / "live"
    known = {live / "sources", live / "emulator.py", SOURCE / "fleet", live / "outputs" / "page.py"}
    for path in (p for p in SOURCE.rglob("*.py") if not known & {p, *p.parents}):
        names = {
            name
            for one, several in IMPORT.findall(path.read_text(encoding="utf-8"))
            for name in [one, *re.findall(r"[\w.]+", several)]
        }
        # Taking an address apart opens nothing.
        assert not {n.partition(".")[0] for n in names - {"urllib.parse"}} & NETWORK, path


def test_imports_of_the_network_are_seen():
    code = "import os, socket\n    from urllib.request import urlopen\nimport http.client as c\n"
    assert [one or several for one, several in IMPORT.findall(code)] == [
        "os, socket", "urllib.request", "http.client as c",
    ]  # fmt: skip


def test_no_command_opens_a_connection_or_starts_a_program(tmp_path):
    car = tmp_path / "car.toml"
    car.write_text("[vehicle]\n[mounting]\nroll_deg = 0\npitch_deg = 0\nyaw_deg = 0\n")
    report = tmp_path / "r.html"
    commands = (
        ("inspect", GOLDEN / "csv", "--vehicle", car),
        ("inspect", GOLDEN / "can.blf", "--dbc", GOLDEN / "golden.dbc"),
        ("convert", GOLDEN / "log.gpx", tmp_path / "out.mf4"),
        ("weigh", GOLDEN / "csv", "--vehicle", car, "--report", report, "--json", "-"),
    )
    ran = subprocess.run(
        [sys.executable, "-c", FORBIDDING + RUN, json.dumps(commands, default=os.fspath)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout.splitlines()[-1] == "[0, 0, 0, 1]", ran.stderr
    page = report.read_text(encoding="utf-8")
    own = page[: page.index("<script>")] + page[page.rindex("<script>") :]
    assert "http" not in own.replace('http-equiv="', "").replace("http://www.w3.org", "")


def test_the_guard_of_this_test_works():
    code = "import socket\nsocket.create_connection(('localhost', 9))"
    ran = subprocess.run(
        [sys.executable, "-c", f"{FORBIDDING}sys.addaudithook(forbid)\n{code}"],
        capture_output=True,
        check=False,
    )
    assert ran.returncode == 99
