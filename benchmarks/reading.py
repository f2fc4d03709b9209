"""How fast raw CAN logs are read, and in how much memory.

Run from the checkout: ``python benchmarks/reading.py``. Recorded: the MF4 files of
``../shared/data`` of about 2.5 MB. Synthetic: one hour of a 500 kbit/s bus, 2400 frames a
second (about 60 % load), with 40 identifiers of which a DBC decodes two signals of 100 Hz,
and OBD-II answers ten times a second; as MF4, BLF, candump, ASC and TRC; and one hour of 1000
frames of CAN FD a second, of 64 bytes, as candump. The loop of python-can
and cantools over the same frames, with the same signals, is timed on the first five minutes.
Every reading is a process of its own, so that its memory is its own.
"""

from __future__ import annotations

import json
import struct
import subprocess
import sys
import tempfile
import time
import zlib
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
DATA = HERE.parents[1] / "shared" / "data" / "canedge-obd-imu-gnss"
RATE = 2400
IDENTIFIERS = 40
START = 1_600_000_000.0

DBC = """VERSION ""
BS_:
BU_:
BO_ 256 Motion: 8 X
 SG_ Accel : 0|16@1- (0.001,0) [-30|30] "m/s^2" X
 SG_ Speed : 23|16@0+ (0.01,0) [0|300] "km/h" X
"""
MAPPING = {
    "signals": {"longitudinal_accel": {"column": "Accel"}, "vehicle_speed": {"column": "Speed"}}
}


def synthetic(seconds: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, identifiers and data of a busy bus."""
    n = seconds * RATE
    k = np.arange(n)
    identifier = (256 + k % IDENTIFIERS).astype(np.uint32)
    data = np.random.default_rng(1).integers(0, 256, (n, 8), dtype=np.uint8)
    # 2400 frames over 40 identifiers are 60 Hz each; two places in a second carry answers.
    answer = k % (RATE // 10) == 7
    identifier[answer] = 0x7E8
    data[answer] = [4, 0x41, 0x0C, 0x1A, 0xF8, 0, 0, 0]
    return k / RATE, identifier, data


def write_mf4(path: Path, seconds: int) -> None:
    from asammdf import MDF, Signal, Source

    t, identifier, data = synthetic(seconds)
    kinds = [("BusChannel", "u1"), ("ID", "<u4"), ("IDE", "u1"), ("DLC", "u1"),
             ("DataLength", "u1"), ("DataBytes", "(8,)u1")]  # fmt: skip
    rows = np.zeros(t.size, [(f"CAN_DataFrame.{n}", k) for n, k in kinds])
    rows["CAN_DataFrame.BusChannel"] = 1
    rows["CAN_DataFrame.ID"] = identifier
    rows["CAN_DataFrame.DLC"] = rows["CAN_DataFrame.DataLength"] = 8
    rows["CAN_DataFrame.DataBytes"] = data
    file = MDF(version="4.11")
    file.header.start_time = datetime.fromtimestamp(START, UTC)
    source = Source("CAN", "CAN", "", Source.SOURCE_BUS, Source.BUS_TYPE_CAN)
    file.append(Signal(rows, t, name="CAN_DataFrame", source=source), acq_source=source)
    file.save(path, overwrite=True)
    file.close()


def write_blf(path: Path, seconds: int) -> None:
    t, identifier, data = synthetic(seconds)
    row = np.dtype(
        [("mark", "S4"), ("head", "<u2"), ("version", "<u2"), ("size", "<u4"), ("kind", "<u4"),
         ("flags", "<u4"), ("rest", "<u4"), ("time", "<u8"), ("channel", "<u2"), ("dir", "u1"),
         ("dlc", "u1"), ("id", "<u4"), ("data", "(8,)u1")]
    )  # fmt: skip
    rows = np.zeros(t.size, row)
    rows["mark"], rows["head"], rows["version"], rows["size"], rows["kind"] = b"LOBJ", 32, 1, 48, 1
    rows["flags"], rows["time"], rows["channel"], rows["dlc"] = 2, np.round(t * 1e9), 1, 8
    rows["id"], rows["data"] = identifier, data
    raw = memoryview(rows).cast("B")
    with path.open("wb") as file:
        start = struct.pack("<8H", 2020, 9, 0, 13, 12, 26, 40, 0)
        file.write((b"LOGG" + struct.pack("<L", 144) + bytes(32) + start).ljust(144, b"\0"))
        for at in range(0, len(raw), 1 << 17):
            plain = raw[at : at + (1 << 17)]
            packed = zlib.compress(plain, 1)
            size = 32 + len(packed)
            file.write(struct.pack("<4sHHLL", b"LOBJ", 16, 1, size, 10))
            file.write(struct.pack("<H6xL4x", 2, len(plain)) + packed + bytes(size % 4))


def lines(path: Path, seconds: int, head: str, line: Callable[[int, float, int, str], str]) -> None:
    """Write one line of text a frame, of its number, time, identifier and bytes."""
    t, identifier, data = synthetic(seconds)
    with path.open("w") as file:
        file.write(head)
        for at in range(0, t.size, 100_000):
            part = slice(at, at + 100_000)
            rows = zip(t[part].tolist(), identifier[part].tolist(), data[part], strict=True)
            file.writelines(
                line(at + k, s, i, d.tobytes().hex(" ").upper()) for k, (s, i, d) in enumerate(rows)
            )


def write_candump(path: Path, seconds: int) -> None:
    lines(path, seconds, "", lambda _, s, i, d: f"({START + s:.6f}) can1 {i:03X}#"
          f"{d.replace(' ', '')}\n")  # fmt: skip


def write_shown(path: Path, seconds: int) -> None:
    """Write candump as a terminal shows it."""
    lines(path, seconds, "",
          lambda _, s, i, d: f" ({START + s:.6f})  can1  {i:03X}   [8]  {d}\n")  # fmt: skip


def write_fd(path: Path, seconds: int) -> None:
    """Write candump of 1000 frames of CAN FD a second, the answers among them classic."""
    _, identifier, data = synthetic(seconds)
    with path.open("w") as file:
        for k in range(1000 * seconds):
            text = data[k].tobytes().hex().upper()
            text = f"#{text}" if identifier[k] == 0x7E8 else f"##1{8 * text}"
            file.write(f"({START + k / 1000:.6f}) can1 {identifier[k]:03X}{text}\n")


def write_asc(path: Path, seconds: int) -> None:
    date = datetime.fromtimestamp(START).strftime("%a %b %d %H:%M:%S.0 %Y")
    head = f"date {date}\nbase hex  timestamps absolute\ninternal events logged\n"
    lines(path, seconds, f"{head}Begin Triggerblock {date}\n 0.000000 Start of measurement\n",
          lambda _, s, i, d: f" {s:.6f} 1  {i:<15X} Rx   d 8 {d}\n")  # fmt: skip


def write_trc(path: Path, seconds: int) -> None:
    head = f";$FILEVERSION=2.1\n;$STARTTIME={START / 86400 + 25569}\n;$COLUMNS=N,O,T,B,I,d,R,L,D\n"
    lines(path, seconds, head,
          lambda k, s, i, d: f"{k:>7} {1e3 * s:13.3f} DT  1 {i:>8X} Rx -  8    {d}\n")  # fmt: skip


WRITERS = {
    ".mf4": write_mf4,
    ".blf": write_blf,
    ".log": write_candump,
    ".asc": write_asc,
    ".trc": write_trc,
}

# The largest the process itself ever was; getrusage would count its parent's before exec.
PEAK = """
def peak():
    line = next(x for x in open("/proc/self/status") if x.startswith("VmHWM"))
    return int(line.split()[1]) * 1024 / 1e9
"""

READ = (
    PEAK
    + """
import json, sys, time
from weighbridge.io import read_drive
import asammdf, cantools, can
began = time.perf_counter()
mapping = json.loads(sys.argv[2]) if sys.argv[2].startswith("{") else sys.argv[2]
drive = read_drive(sys.argv[1], mapping, sys.argv[3])
took = time.perf_counter() - began
print(json.dumps([took, drive.duration, peak(),
                  sum(map(len, drive.signals.values()))]))
"""
)

LOOP = (
    PEAK
    + """
import json, sys, time
import can, cantools
from asammdf import MDF
began = time.perf_counter()
dbc = cantools.database.load_file(sys.argv[3])
known = {m.frame_id for m in dbc.messages}
values = answers = 0
for m in can.LogReader(sys.argv[1]):
    if m.arbitration_id in known:
        values += len(dbc.decode_message(m.arbitration_id, m.data))
    elif m.arbitration_id == 0x7E8 and m.data[1] == 0x41:
        values += 1
print(json.dumps([time.perf_counter() - began, m.timestamp - 1.6e9,
                  peak(), values]))
"""
)


def run(program: str, log: Path, mapping: str, dbc: Path) -> list[float]:
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", program, str(log), mapping, str(dbc)],
        check=True, capture_output=True, text=True,
    )  # fmt: skip
    return json.loads(done.stdout.splitlines()[-1])


def show(what: str, log: Path, found: list[float]) -> None:
    took, seconds, memory, values = found
    print(
        f"| {what} | {log.stat().st_size / 1e6:.1f} | {seconds:.0f} | {took:.2f} "
        f"| {seconds / took:.0f} | {memory:.2f} | {values:.0f} |",
        flush=True,
    )


def main(seconds: int = 3600) -> None:
    print("| log | MB | s recorded | s to read | times real time | GB | values |")
    print("|---|---|---|---|---|---|---|")
    if DATA.is_dir():
        example = str(HERE.parent / "examples" / "canedge" / "mapping.toml")
        for log in sorted(DATA.glob("*/*.MF4")):
            if log.stat().st_size > 2_000_000:
                show(f"{log.stem}, recorded", log, run(READ, log, example, DATA / "canmod-gps.dbc"))
    with tempfile.TemporaryDirectory() as folder:
        dbc = Path(folder, "motion.dbc")
        dbc.write_text(DBC)
        mapping = json.dumps(MAPPING)
        hours = [(suffix, suffix, write) for suffix, write in WRITERS.items()]
        hours += [(".log, as shown", ".log", write_shown), (".log, CAN FD", ".log", write_fd)]
        for what, suffix, write in hours:
            log = Path(folder, f"hour{suffix}")
            began = time.perf_counter()
            write(log, seconds)
            print(f"# written in {time.perf_counter() - began:.0f} s", file=sys.stderr)
            show(f"synthetic {what}", log, run(READ, log, mapping, dbc))
            log.unlink()
        for suffix in (".blf", ".log", ".asc", ".trc"):
            log = Path(folder, f"loop{suffix}")
            WRITERS[suffix](log, 300)
            show(f"five minutes {suffix}", log, run(READ, log, mapping, dbc))
            show(f"five minutes {suffix}, python-can and cantools", log, run(LOOP, log, "", dbc))


if __name__ == "__main__":
    main(*map(int, sys.argv[1:2]))
