"""Orders that come by a file: lines of a pipe, or of a file that is appended to."""

import os
import stat

import pytest

from tests.noted import error
from weighbridge import ConfigError
from weighbridge.live import OrderFile, order_file

needs_pipes = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no named pipes")


def written(path, text):
    with path.open("a") as file:
        file.write(text)


@needs_pipes
def test_a_pipe_is_made_and_taken_away(tmp_path):
    path = tmp_path / "orders"
    with order_file(path) as file:
        assert stat.S_ISFIFO(path.stat().st_mode)
        assert stat.S_IMODE(path.stat().st_mode) == 0o600
        assert file.read() == []
        written(path, "tare\nlo")
        assert file.read() == ["tare"]
        written(path, "ad\r\n\nend\n")
        assert file.read() == ["load", "end"]
        assert file.read() == []
    assert not path.exists()


@needs_pipes
def test_a_pipe_that_was_there_stays(tmp_path):
    path = tmp_path / "orders"
    os.mkfifo(path)
    with order_file(path):
        pass
    assert path.exists()


def test_of_a_file_only_what_is_appended_is_done(tmp_path):
    path = tmp_path / "orders"
    path.write_text("end\n")
    with order_file(path) as file:
        assert file.read() == []
        written(path, "load\n")
        assert file.read() == ["load"]
        # Emptied and begun anew.
        path.write_text("t\n")
        assert file.read() == ["t"]
    assert path.exists()


@needs_pipes
def test_noise_without_end_is_no_order_and_does_not_grow(tmp_path):
    path = tmp_path / "orders"
    with order_file(path) as file:
        for _ in range(50):
            written(path, "\xff\x00" * 1000)
            assert file.read() == []
            assert len(file._rest) <= 8192
        written(path, "\ntare\n")
        assert file.read()[-1] == "tare"


def test_without_a_path_there_are_none():
    with order_file(None) as file:
        assert file is None


def test_what_cannot_be_read_is_refused(tmp_path):
    with error(ConfigError, tmp_path):
        OrderFile(tmp_path)
    with error(ConfigError, "gone/orders"):
        OrderFile(tmp_path / "gone" / "orders")
