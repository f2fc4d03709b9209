import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from weighbridge.io import join_messages
from weighbridge.io.frames import Frames, bits, join_frames, settle_clock


def make(time, identifier=0x100, data=None, channel=1, extended=False, width=8):
    """Frames of one identifier; ``data`` is a list of bytes."""
    time = np.asarray(time, float)
    n = time.size
    data = data if data is not None else [b"\0" * 8] * n
    padded = np.zeros((n, width), np.uint8)
    for row, content in zip(padded, data, strict=True):
        row[: len(content)] = list(content)
    return Frames(
        time,
        np.full(n, channel, np.int16),
        np.full(n, identifier, np.uint32),
        np.full(n, extended),
        np.array([len(c) for c in data], np.uint8),
        padded,
    )


def test_joined_frames_are_in_order_and_keep_their_data():
    a = make([0.0, 2.0], 0x10, [b"\x01", b"\x02"])
    b = make([1.0, 3.0], 0x18FEF100, [bytes(range(12)), b"\x04"], 2, True, width=12)
    joined = join_frames([a, b])
    assert_array_equal(joined.time, [0, 1, 2, 3])
    assert_array_equal(joined.data[1], range(12))
    assert joined.data.shape == (4, 12)
    assert joined.counts() == {(1, 0x10, False): 2, (2, 0x18FEF100, True): 2}
    assert len(joined.select(joined.extended)) == 2


def test_counter_that_wraps_is_mended():
    time = np.arange(0.0, 20.0, 0.5)
    wrapped = np.where(time >= 10.0, time - 2**32 * 1e-6, time) + 2**32 * 1e-6
    frames, problems = settle_clock(make(wrapped), "x.blf")
    assert_allclose(frames.time - frames.time[0], time, atol=1e-9)
    assert problems[0].id == "clock.wrapped"


def test_clock_set_back_keeps_the_longest_part():
    time = np.concatenate([np.arange(30.0) + 500.0, np.arange(10.0)])
    frames, problems = settle_clock(make(time), "x.log")
    assert_array_equal(frames.time, np.arange(30.0) + 500.0)
    assert problems[0].id == "clock.frames_jump"
    assert (problems[0].values["count"], problems[0].values["frames"]) == (10, 40)


def test_clock_set_forward_keeps_the_longest_part():
    time = np.concatenate([np.arange(5.0), np.arange(30.0) + 1.6e9])
    frames, problems = settle_clock(make(time), "x.log")
    assert frames.time[0] == 1.6e9
    assert problems[0].id == "clock.frames_jump"
    assert (problems[0].values["count"], problems[0].values["frames"]) == (5, 35)
    # A clock that counts from 1970 is told as a time of day.
    assert problems[0].id == "clock.frames_jump"
    assert "e+09" not in problems[0].text


def test_frames_a_little_out_of_order_are_sorted_without_a_word():
    frames, problems = settle_clock(make([0.0, 0.2, 0.1, 0.3]), "x.log")
    assert_array_equal(frames.time, [0.0, 0.1, 0.2, 0.3])
    assert problems == []


def split(message, first=6, size=7):
    """Frames of a message as ISO 15765-2 lays it out."""
    parts = [bytes([0x10 | len(message) >> 8, len(message) & 0xFF]) + message[:first]]
    rest, k = message[first:], 1
    while rest:
        parts.append(bytes([0x20 | k & 0xF]) + rest[:size].ljust(size, b"\x55"))
        rest, k = rest[size:], k + 1
    return parts


def test_long_messages_are_put_together_whatever_their_length():
    rng = np.random.default_rng(3)
    messages = [bytes(rng.integers(0, 256, n, dtype=np.uint8)) for n in (8, 13, 14, 20, 150, 255)]
    parts = [p for m in messages for p in split(m)]
    got = join_messages(make(0.01 * np.arange(len(parts)), data=parts))
    assert got.broken == 0
    assert [bytes(d[:n]) for d, n in zip(got.data, got.length, strict=True)] == messages


def test_long_messages_of_can_fd():
    message = bytes(range(1, 151))
    parts = split(message, first=62, size=63)
    got = join_messages(make(0.01 * np.arange(len(parts)), data=parts, width=64))
    assert bytes(got.data[0, : got.length[0]]) == message
    single = join_messages(make([0.0], data=[bytes([0, 20]) + bytes(range(20))], width=64))
    assert bytes(single.data[0, : single.length[0]]) == bytes(range(20))


def test_messages_with_parts_missing_are_counted_not_guessed():
    whole = split(bytes(range(100, 130)))
    lost = [whole[0], whole[1], whole[3], whole[4]]
    swapped = [whole[0], whole[2], whole[1], *whole[3:]]
    late = list(whole)
    parts = [*lost, *whole, *swapped, *late]
    time = 0.01 * np.arange(len(parts))
    time[-2:] += 5.0
    got = join_messages(make(time, data=parts))
    assert got.broken == 3
    assert_allclose(got.time, [0.04])
    assert bytes(got.data[0, :30]) == bytes(range(100, 130))


def test_single_frames_that_claim_more_than_they_hold_are_left_out():
    got = join_messages(make([0.0, 1.0], data=[b"\x07\x41\x0c", b"\x02\x41\x0c"]))
    assert_array_equal(got.length, [2])
    assert_array_equal(got.time, [1.0])


@pytest.mark.parametrize(("order", "big_endian"), [("<u8", False), (">u8", True)])
def test_numbers_of_bits_are_those_of_the_whole_number(order, big_endian):
    data = np.random.default_rng(1).integers(0, 256, (50, 8)).astype(np.uint8)
    whole = [int(x) for x in data.view(order)[:, 0]]
    for first in range(64):
        for count in range(1, 65 - first):
            behind = 64 - first - count if big_endian else first
            expected = [(x >> behind) % (1 << count) for x in whole]
            found = bits(data, first, count, big_endian=big_endian)
            assert found.tolist() == expected


def test_bytes_behind_the_last_read_as_zero():
    data = np.array([[0xFF, 0xFF]], np.uint8)
    assert bits(data, 12, 8).tolist() == [0x0F]
    assert bits(data, 12, 8, big_endian=True).tolist() == [0xF0]
