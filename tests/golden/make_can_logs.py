"""Write the small CAN logs of this folder: the same ten seconds in every format.

Run it from anywhere: ``python tests/golden/make_can_logs.py``. On bus 1 an engine
(0x7E8) answers OBD-II requests twice a second, with one message of five
parameters in two frames, and a gearbox (0x7E9) with the speed; on bus 2 a
sensor sends a message with 29 bits that `golden.dbc` describes, multiplexed.
`ANSWERS` and `truth` are what any reader has to find.
"""

from pathlib import Path

import can
import numpy as np

HERE = Path(__file__).parent
START = 1_600_000_000.0
STEPS = np.arange(20)
SENSOR = 0x18FF1234
SUFFIXES = (".blf", ".asc", ".trc", ".log", ".csv")

DBC = """VERSION ""
BS_:
BU_:
BO_ 2566853172 Sensor: 8 Vector__XXX
 SG_ Valid : 0|1@1+ (1,0) [0|1] "" Vector__XXX
 SG_ Kind M : 4|4@1+ (1,0) [0|15] "" Vector__XXX
 SG_ Forward m0 : 8|16@1- (0.001,0) [-30|30] "m/s^2" Vector__XXX
 SG_ Lateral m0 : 31|16@0- (0.001,0) [-30|30] "m/s^2" Vector__XXX
 SG_ Height m1 : 12|20@1+ (0.01,-500) [-500|9000] "m" Vector__XXX
BO_ 291 Unused: 8 Vector__XXX
 SG_ Something : 0|8@1+ (1,0) [0|255] "" Vector__XXX
"""


def truth(name: str, step: np.ndarray) -> np.ndarray:
    """Value of a quantity at a step of half a second, in SI."""
    match name:
        case "vehicle_speed":
            return 2.0 * step / 3.6
        case "engine_speed":
            return (800.0 + 50.0 * step) * np.pi / 30.0
        case "engine_torque_fraction":
            return (20.0 + step) / 100.0
        case "throttle":
            return (10.0 + step) / 255.0
        case "ambient_temperature":
            return np.full(step.size, 293.15)
        case "accel_x":
            return 0.5 + 0.01 * step
        case "accel_y":
            return -0.25 - 0.001 * step
        case "altitude":
            return 512.34 + step
    raise KeyError(name)


def frames() -> list[can.Message]:
    """All frames, in the order of time."""
    sent = []

    def send(time: float, channel: int, identifier: int, data: bytes) -> None:
        extended = identifier > 0x7FF
        sent.append(
            can.Message(
                timestamp=START + time,
                arbitration_id=identifier,
                is_extended_id=extended,
                channel=channel,
                data=data,
            )
        )

    for k in STEPS.tolist():
        t = 0.5 * k
        rpm = 4 * (800 + 50 * k)
        answer = bytes(
            [0x41, 0x0C, rpm >> 8, rpm & 255, 0x0D, 2 * k, 0x11, 10 + k, 0x62, 145 + k, 0x46, 60]
        )
        send(t, 0, 0x7DF, bytes([6, 1, 0x0C, 0x0D, 0x11, 0x62, 0x46, 0]))
        send(t + 0.010, 0, 0x7E8, bytes([0x10, len(answer)]) + answer[:6])
        send(t + 0.012, 0, 0x7E9, bytes([3, 0x41, 0x0D, 2 * k, 0, 0, 0, 0]))
        send(t + 0.015, 0, 0x7E0, bytes([0x30, 0, 0, 0, 0, 0, 0, 0]))
        send(t + 0.020, 0, 0x7E8, bytes([0x21]) + answer[6:].ljust(7, b"\xaa"))
        x, y = 500 + 10 * k, -250 - k
        valid = 0 if k == 3 else 1
        accel = (
            bytes([valid])
            + x.to_bytes(2, "little", signed=True)
            + y.to_bytes(2, "big", signed=True)
            + bytes(3)
        )
        height = (101234 + 100 * k) << 12 | 1 << 4 | valid
        send(t + 0.100, 1, SENSOR, accel)
        send(t + 0.200, 1, SENSOR, height.to_bytes(8, "little"))
        send(t + 0.300, 1, 0x456, bytes([k]))
    return sent


def write_mf4(path: Path, messages: list[can.Message]) -> None:
    """Write an MF4 with bus logging, compressed."""
    from asammdf import MDF, Signal, Source

    kinds = [
        ("BusChannel", "<u1"), ("ID", "<u4"), ("IDE", "<u1"), ("DLC", "<u1"),
        ("DataLength", "<u1"), ("DataBytes", "(8,)u1"),
    ]  # fmt: skip
    rows = np.zeros(len(messages), [(f"CAN_DataFrame.{n}", t) for n, t in kinds])
    for row, m in zip(rows, messages, strict=True):
        data = bytes(m.data).ljust(8, b"\0")
        row["CAN_DataFrame.BusChannel"] = m.channel + 1
        row["CAN_DataFrame.ID"] = m.arbitration_id
        row["CAN_DataFrame.IDE"] = m.is_extended_id
        row["CAN_DataFrame.DLC"] = row["CAN_DataFrame.DataLength"] = len(m.data)
        row["CAN_DataFrame.DataBytes"] = list(data)
    time = np.array([m.timestamp for m in messages]) - START
    from datetime import UTC, datetime

    file = MDF(version="4.11")
    file.header.start_time = datetime.fromtimestamp(START, UTC)
    source = Source("CAN", "CAN", "", Source.SOURCE_BUS, Source.BUS_TYPE_CAN)
    file.append(Signal(rows, time, name="CAN_DataFrame", source=source), acq_source=source)
    file.save(path, overwrite=True, compression=2)
    file.close()


if __name__ == "__main__":
    for suffix in SUFFIXES:
        with can.Logger(HERE / f"can{suffix}") as logger:
            for message in frames():
                logger(message)
    # python-can writes where the file lay on this machine.
    trace = HERE / "can.trc"
    trace.write_bytes(trace.read_bytes().replace(str(HERE).encode() + b"/", b""))
    write_mf4(HERE / "can.mf4", frames())
    (HERE / "golden.dbc").write_text(DBC, encoding="utf-8")
