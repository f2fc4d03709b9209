"""What a calibration without an accelerometer asks for where its road load is nonsense."""

from types import SimpleNamespace

import numpy as np
import pytest

import weighbridge as wb
from weighbridge.calibration.joint import _would_help
from weighbridge.signals import Signal

TIME = np.arange(10.0)


def asked(kind, *names):
    drive = wb.Drive("d", {n: Signal(n, TIME, TIME) for n in ("vehicle_speed", *names)})
    recordings = (SimpleNamespace(drive=drive),)
    return _would_help(SimpleNamespace(recordings=recordings, base=wb.Vehicle(name="v", kind=kind)))


@pytest.mark.parametrize(
    ("kind", "names", "words"),
    [
        ("truck", (), "an inertial sensor or GNSS heights or a brake switch or the torque of its"),
        ("truck", ("altitude", "brake_switch", "retarder_torque"), "an inertial sensor"),
        ("car", ("grade",), "an inertial sensor or a brake switch"),
    ],
)
def test_only_what_is_lacking_is_asked_for(kind, names, words):
    assert asked(kind, *names).startswith(words)
    assert ("GNSS heights" in asked(kind, *names)) == (not {"altitude", "grade"} & set(names))
    assert ("retarder" in asked(kind, *names)) == (kind == "truck" and not names)
