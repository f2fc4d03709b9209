"""A live source of another package: one file with the source, one line that names it."""

import socket
import time

import numpy as np
import pytest
from tests.noted import error
from tests.recipes import code, entry_points

from weighbridge import ConfigError
from weighbridge.live import SOURCES, Feed, parse_source


@pytest.fixture
def package(tmp_path, monkeypatch):
    """Install a distribution of one module."""
    (tmp_path / "pulse_source.py").write_text(code("pulse_source.py"))
    info = tmp_path / "pulse_source-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: pulse-source\nVersion: 1.0\n")
    line = entry_points()["weighbridge.sources"]
    (info / "entry_points.txt").write_text(f"[weighbridge.sources]\n{line}\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(SOURCES, "_all", None)


def heard(feed, condition):
    """Read a feed until a condition on the speeds' instants and values holds."""
    times, values = [], []
    limit = time.monotonic() + 5.0
    while not condition(values) and time.monotonic() < limit:
        for block in feed.read(0.05):
            times.extend(block["vehicle_speed"][0])
            values.extend(block["vehicle_speed"][1])
    assert condition(values)
    return np.array(times), np.array(values)


def test_a_package_adds_a_source(package):
    with socket.create_server(("127.0.0.1", 0)) as server:
        source = parse_source(f"pulses:tcp:127.0.0.1:{server.getsockname()[1]}")
        with Feed([source], pauses=(0.05, 0.1)) as feed:
            client, _ = server.accept()
            # Its counter begins anew on the way, and a line is damaged.
            client.sendall(b"damaged,line\n")
            for k in range(20):
                stamp = (2**32 - 100 + 10 * k) % 2**32
                client.sendall(f"{stamp},{36.0 + k}\n".encode())
                time.sleep(0.01)
            times, values = heard(feed, lambda values: len(values) == 20)
            np.testing.assert_allclose(values, 10.0 + np.arange(20) / 3.6)
            assert times[-1] - times[0] == pytest.approx(0.19, abs=0.05)
            # Unplugged and back.
            client.close()
            client, _ = server.accept()
            client.sendall(b"0,72\n")
            assert heard(feed, len)[1].tolist() == [20.0]
            client.close()


def test_without_the_package_the_kind_is_unknown():
    with error(ConfigError, "pulses:/dev/ttyUSB2"):
        parse_source("pulses:/dev/ttyUSB2")
