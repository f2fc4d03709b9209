"""What a calibration without an accelerometer asks for where its road load is nonsense."""

from types import SimpleNamespace

import numpy as np
import pytest

import weighbridge as wb
from weighbridge import Signal
from weighbridge.calibration.joint import _would_help
from weighbridge.messages import phrase

TIME = np.arange(10.0)


def asked(kind, *names):
    drive = wb.Drive("d", {n: Signal(n, TIME, TIME) for n in ("vehicle_speed", *names)})
    recordings = (SimpleNamespace(drive=drive),)
    return _would_help(SimpleNamespace(recordings=recordings, base=wb.Vehicle(name="v", kind=kind)))


@pytest.mark.parametrize(
    ("kind", "names", "lacking"),
    [
        ("truck", (), ("gnss_heights", "a_brake_switch", "retarder_torque")),
        ("truck", ("altitude", "brake_switch", "retarder_torque"), ()),
        ("car", ("grade",), ("a_brake_switch",)),
    ],
)
def test_only_what_is_lacking_is_asked_for(kind, names, lacking):
    wanted = [phrase(name) for name in ("an_inertial_sensor", *lacking)]
    assert asked(kind, *names) == " or ".join(wanted)
