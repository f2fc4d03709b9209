"""Make openpilot_rlog.bz2 by pycapnp and the schema that openpilot publishes (its log.capnp).

python make_openpilot_log.py CEREAL/log.capnp
"""

import bz2
import sys
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
STEPS = 60
STEP = 0.1
START = 1000.0
AGE = 0.004
"""The sensor's stamp is so much older than the log's [s]."""

FIX_MILLIS = 1_777_629_600_000


def truth(name, t):
    """Values of one channel at seconds from the start, in the log's unit."""
    t = np.asarray(t)
    return {
        "vEgoRaw": 10.0 + 0.5 * t,
        "engineRpm": 1500.0 + 10.0 * t,
        "gas": np.where(t > 3.0, 0.25, 0.0),
        "brake": (t < 1.0).astype(float),
        "accel": 9.8 + 0.01 * t,
        "gyro": 0.02 * t,
        "latitude": 32.7 + 1e-4 * t,
    }[name]


def events(log):
    """Events of some seconds, in the order in which a device logs them."""
    for k in range(STEPS):
        t = k * STEP
        now = {n: float(truth(n, t)) for n in ("vEgoRaw", "engineRpm", "gas", "brake")}
        stamp = round((START + t) * 1e9)
        event = log.Event.new_message(logMonoTime=stamp)
        car = event.init("carState")
        car.vEgo, car.vEgoRaw, car.engineRpm = 99.0, now["vEgoRaw"], now["engineRpm"]
        car.gas, car.brakePressed = now["gas"], bool(now["brake"])
        car.wheelSpeeds.fl = 88.0
        yield event
        event = log.Event.new_message(logMonoTime=stamp)
        reading = event.init("accelerometer")
        reading.sensor, reading.type, reading.timestamp = 1, 1, stamp - round(AGE * 1e9)
        reading.init("acceleration").v = [float(truth("accel", t)), 0.1, 0.2]
        reading.source = "lsm6ds3trc"
        yield event
        event = log.Event.new_message(logMonoTime=stamp)
        reading = event.init("gyroscope")
        reading.sensor, reading.type, reading.timestamp = 5, 16, stamp - round(AGE * 1e9)
        reading.init("gyroUncalibrated").v = [float(truth("gyro", t)), 0.0, 0.0]
        yield event
        # Engine speed as an answer of OBD-II, and a frame that the device sent itself.
        raw = round(4 * now["engineRpm"])
        event = log.Event.new_message(logMonoTime=stamp)
        can = event.init("can", 2)
        can[0].address, can[0].src = 0x7E8, 1
        can[0].dat = bytes([4, 0x41, 0x0C, raw >> 8, raw & 255, 0, 0, 0])
        can[1].address, can[1].src, can[1].dat = 0x7E8, 129, bytes(8)
        yield event
        if k % 10 == 0:
            event = log.Event.new_message(logMonoTime=stamp)
            place = event.init("gpsLocationExternal")
            place.hasFix, place.latitude, place.longitude = (
                k > 0,
                float(truth("latitude", t)),
                -117.0,
            )
            place.altitude, place.speed, place.bearingDeg = 20.0, now["vEgoRaw"], 90.0
            place.horizontalAccuracy, place.unixTimestampMillis = 1.5, FIX_MILLIS + round(1e3 * t)
            yield event
        event = log.Event.new_message(logMonoTime=stamp)
        event.logMessage = "a line of text"
        yield event


if __name__ == "__main__":
    import capnp

    capnp.remove_import_hook()
    published = capnp.load(sys.argv[1])
    data = b"".join(e.to_bytes() for e in events(published))
    (HERE / "openpilot_rlog.bz2").write_bytes(bz2.compress(data))
