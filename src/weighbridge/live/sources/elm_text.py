"""What an ELM327 adapter says, taken apart: answers of control units, and its own words.

Adapters differ in echo, spaces, headers and line ends; every line is taken for what it looks like.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from weighbridge.io import join_messages
from weighbridge.io.frames import Frames

TROUBLES: Final = (
    "NO DATA", "UNABLE TO CONNECT", "STOPPED", "BUS ERROR", "CAN ERROR", "BUS BUSY", "DATA ERROR",
    "BUFFER FULL", "FB ERROR", "RX ERROR", "LV RESET", "LP ALERT", "ACT ALERT", "ERROR", "ERR", "?",
)  # fmt: skip
"""Words that say why there is no answer (ELM327 data sheet, error messages)."""

RESTARTED: Final = ("LV RESET", "ELM327")
"""Words of an adapter that has begun anew and forgotten how it was set up."""

_BEFORE_DATA: Final = re.compile(r"^(?:SEARCHING\.*|BUS INIT:?[ .]*(?:OK)?)\s*")
_HEX: Final = re.compile(r"^[0-9A-F]+$")
_PART: Final = re.compile(r"^([0-9A-F]):([0-9A-F]+)$")
_VOLTS: Final = re.compile(r"\b(\d{1,2}\.\d{1,2})\s*V", re.IGNORECASE)

_CURRENT_DATA: Final = "41"
# Adapters whose voltmeter is not connected say 0.0 V.
_LEAST_VOLTAGE: Final = 6.0


@dataclass(slots=True)
class Reply:
    """What came before one prompt.

    Attributes
    ----------
    answers : payloads by control unit: its identifier or address, 0 where headers are off
    trouble : the adapter's word for why there is none; empty where there is
    restarted : whether the adapter has begun anew
    """

    answers: dict[int, list[bytes]] = field(default_factory=dict)
    trouble: str = ""
    restarted: bool = False


def read_reply(text: str, command: str) -> Reply:
    """Take a reply apart.

    Parameters
    ----------
    text : up to the prompt
    command : what was sent, which may be echoed
    """
    reply = Reply()
    frames: list[tuple[int, bool, bytes]] = []
    parts: dict[int, str] = {}
    size = 0
    for raw in re.split(r"[\r\n>]+", text.replace("\0", "").upper()):
        line = _BEFORE_DATA.sub("", raw.strip())
        digits = line.replace(" ", "")
        if not digits or digits == command.replace(" ", "").upper():
            continue
        if any(word in line for word in RESTARTED):
            reply.restarted = True
        elif found := _PART.match(digits):
            parts[len(parts)] = found[2]
        elif not _HEX.match(digits):
            trouble = next((word for word in TROUBLES if word in line), "")
            reply.trouble = reply.trouble or trouble
        elif len(digits) == 3:
            size = int(digits, 16)
        else:
            _take(digits, frames, reply.answers)
    _add_parts(parts, size, reply)
    _add_frames(frames, reply)
    if reply.answers:
        reply.trouble = ""
    return reply


def _take(
    digits: str, frames: list[tuple[int, bool, bytes]], answers: dict[int, list[bytes]]
) -> None:
    """Take one line of hexadecimal digits for what it looks like, if it is anything."""
    if len(digits) % 2 == 1:
        # Only an identifier of 11 bits has three digits.
        if re.match(r"7E[89A-F]", digits):
            frames.append((int(digits[:3], 16), False, bytes.fromhex(digits[3:])))
        return
    data = bytes.fromhex(digits)
    if digits.startswith("18DAF1") and len(data) > 4:
        frames.append((int(digits[:8], 16), True, data[4:]))
    elif digits.startswith(_CURRENT_DATA):
        answers.setdefault(0, []).append(data)
    elif len(data) > 5 and data[3] == int(_CURRENT_DATA, 16) and _sound(data):
        answers.setdefault(data[2], []).append(data[3:-1])


def _sound(data: bytes) -> bool:
    """Whether the last byte checks the others: a sum (ISO 9141, ISO 14230) or SAE J1850's CRC."""
    if sum(data[:-1]) & 0xFF == data[-1]:
        return True
    crc = 0xFF
    for byte in data[:-1]:
        crc ^= byte
        for _ in range(8):
            crc = (crc << 1 ^ (0x1D if crc & 0x80 else 0)) & 0xFF
    return crc ^ 0xFF == data[-1]


def _add_parts(parts: dict[int, str], size: int, reply: Reply) -> None:
    """Add a long answer without headers: its length, then numbered parts."""
    data = bytes.fromhex("".join(p if len(p) % 2 == 0 else "" for p in parts.values()))
    if size and len(data) >= size:
        reply.answers.setdefault(0, []).append(data[:size])


def _add_frames(frames: Sequence[tuple[int, bool, bytes]], reply: Reply) -> None:
    """Add answers that come as CAN frames, several of them for a long one."""
    for sender in dict.fromkeys(sender for sender, _, _ in frames):
        mine = [(extended, data[:8]) for s, extended, data in frames if s == sender]
        table = np.zeros((len(mine), 8), np.uint8)
        for row, (_, data) in zip(table, mine, strict=True):
            row[: len(data)] = np.frombuffer(data, np.uint8)
        messages = join_messages(
            Frames(
                1e-3 * np.arange(len(mine), dtype=np.float64),
                np.zeros(len(mine), np.int16),
                np.full(len(mine), sender, np.uint32),
                np.array([extended for extended, _ in mine]),
                np.array([len(data) for _, data in mine], np.uint8),
                table,
            )
        )
        whole = [
            row[:size].tobytes()
            for row, size in zip(messages.data, messages.length.tolist(), strict=True)
        ]
        if whole:
            reply.answers.setdefault(sender, []).extend(whole)


def read_voltage(text: str) -> float | None:
    """Voltage that an adapter says [V]; None where it says none, or one that no vehicle has."""
    found = _VOLTS.search(text)
    volts = float(found[1]) if found else 0.0
    return volts if volts > _LEAST_VOLTAGE else None
