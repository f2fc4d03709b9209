"""An ELM327 adapter at a vehicle with one control unit on CAN: text in, text out.

What it says to which command is in Elm Electronics' data sheet of the ELM327.
"""

from __future__ import annotations

import re
from typing import Final

from weighbridge.io.obd import CURRENT_DATA
from weighbridge.live.emulator.played import Played

NAME: Final = "ELM327 v1.5"

_UNIT: Final = "7E8"
_PROTOCOL: Final = {"DP": "AUTO, ISO 15765-4 (CAN 11/500)", "DPN": "A6"}
_VOLTAGE: Final = "14.1V"
_SWITCH: Final = re.compile(r"([EHSL])([01])")
# Settings that make no difference here: timing, protocol, memory, lengths, CAN formatting.
_WITHOUT_EFFECT: Final = re.compile(r"(?:AT[012]|ST[0-9A-F]{2}|T?SP.+|D|M[01]|AL|NL|CAF[01]|PC)")
_REQUEST: Final = re.compile(r"[0-9A-F]{2,}")
_CURRENT: Final = 0x01
_MOST_TOGETHER: Final = 6
# Bytes of a frame that carry an answer: alone, in the first of several, and in the next ones.
_SINGLE, _FIRST, _NEXT = 7, 6, 7


class Elm327:
    """One adapter that was just plugged in.

    Parameters
    ----------
    vehicle : whom it asks
    """

    def __init__(self, vehicle: Played) -> None:
        self._vehicle = vehicle
        self._before = ""
        self._reset()

    def say(self, command: str) -> str:
        """Return all that comes back for a command, prompt included.

        Parameters
        ----------
        command : without its carriage return; an empty one is the last once more
        """
        echo = command if self._on["E"] else None
        words = "".join(command.upper().split()) or self._before
        self._before = words
        lines = self._lines(words)
        end = "\r\n" if self._on["L"] else "\r"
        return end.join([*([] if echo is None else [echo]), *lines, "", ">"])

    def _reset(self) -> None:
        self._on = {"E": True, "H": False, "S": True, "L": False}

    def _lines(self, words: str) -> list[str]:
        if words.startswith("AT"):
            return [self._set(words.removeprefix("AT"))]
        if not _REQUEST.fullmatch(words):
            return ["?"]
        # A digit at the end says how many answers to wait for.
        request = bytes.fromhex(words[: len(words) - len(words) % 2])
        if request[0] != _CURRENT:
            return ["NO DATA"]
        self._vehicle.begin()
        answer = bytes([CURRENT_DATA])
        for number in request[1 : 1 + _MOST_TOGETHER]:
            value = None if self._vehicle.ended else self._vehicle.answer(number)
            answer += b"" if value is None else bytes([number]) + value
        return self._shown(answer) if len(answer) > 1 else ["NO DATA"]

    def _set(self, words: str) -> str:
        if words in ("Z", "WS"):
            self._reset()
            return f"\r\r{NAME}"
        if words == "I":
            return NAME
        if words == "RV":
            return _VOLTAGE
        if words in _PROTOCOL:
            return _PROTOCOL[words]
        if found := _SWITCH.fullmatch(words):
            self._on[found[1]] = found[2] == "1"
            return "OK"
        return "OK" if _WITHOUT_EFFECT.fullmatch(words) else "?"

    def _shown(self, answer: bytes) -> list[str]:
        """Lines of an answer, each a CAN frame (ISO 15765-2)."""
        size = len(answer)
        if size <= _SINGLE:
            return [self._line(bytes([size]), answer, "")]
        rest = answer[_FIRST:].ljust(-(-(size - _FIRST) // _NEXT) * _NEXT, b"\xaa")
        parts = [answer[:_FIRST], *(rest[k : k + _NEXT] for k in range(0, len(rest), _NEXT))]
        lines = [self._line(bytes([0x10 | size >> 8, size & 0xFF]), parts[0], "0")]
        for k, part in enumerate(parts[1:], 1):
            lines.append(self._line(bytes([0x20 | k & 0xF]), part, f"{k & 0xF:X}"))
        return lines if self._on["H"] else [f"{size:03X}", *lines]

    def _line(self, control: bytes, data: bytes, part: str) -> str:
        """One frame: with its header, or its data alone and which part of the answer it is."""
        gap = " " if self._on["S"] else ""
        if self._on["H"]:
            return gap.join((_UNIT, *(f"{byte:02X}" for byte in control + data)))
        text = gap.join(f"{byte:02X}" for byte in data)
        return f"{part}:{gap}{text}" if part else text
