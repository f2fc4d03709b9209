"""Drives of another simulator, thinned to what makers have: OBD at a few Hz, GNSS, no IMU."""

from dataclasses import replace

import numpy as np
import pytest
from numba import config

import weighbridge as wb
from weighbridge import Signal

pytestmark = pytest.mark.skipif(
    bool(config.DISABLE_JIT), reason="whole drives take minutes without the compiler"
)

POLLED = ("vehicle_speed", "engine_speed", "engine_load", "engine_torque")
GNSS = ("latitude", "longitude", "altitude")


def thinned(drive, rate):
    """Keep OBD at ``rate`` [Hz] and GNSS."""
    signals = {}
    for name in (n for n in (*POLLED, *GNSS) if n in drive.signals):
        s = drive.signals[name]
        if name in POLLED and s.period < 0.95 / rate:
            wanted = np.arange(s.time[0], s.time[-1], 1.0 / rate)
            at = np.unique(np.minimum(np.searchsorted(s.time, wanted), s.time.size - 1))
            s = Signal(name, s.time[at], s.values[at])
        signals[name] = s
    return replace(drive, signals=signals)


@pytest.mark.parametrize(("vehicle", "rate"), [("hatchback", 1.0), ("wagon", 4.0)])
def test_obd_and_gnss_without_an_inertial_sensor(foreign_simulator, vehicle, rate):
    def drive(name):
        return thinned(wb.read_drive(foreign_simulator / vehicle / name), rate)

    limits = wb.Vehicle(name=vehicle, gross=2300.0)
    car = wb.calibrate([drive("calibration-1"), drive("calibration-2")], vehicle=limits)
    assert "not fitted again" not in (car.provenance.notes or "")
    errors = []
    for name in ("drive-1", "drive-3"):
        w = wb.weigh(drive(name), car)
        truth = drive(name).info.mass
        assert abs(w.mass - truth) < 2.0 * w.std
        assert w.std < 0.065 * w.mass
        errors.append(w.mass / truth - 1.0)
    assert np.sqrt(np.mean(np.square(errors))) < 0.04
