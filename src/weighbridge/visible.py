"""Text of files, made safe to show: no control character acts, and nothing is endless."""

from __future__ import annotations

import re
from typing import Final

LONGEST: Final = 1900
"""Characters of a message that are shown: a screen of 24 lines of 80."""

# C0, delete and C1; line and paragraph separators; marks that turn the direction of
# writing (Unicode 16.0, UAX 9); invisible tags; halves of surrogate pairs, which mean
# the bytes of names that are no UTF-8.
_ACTING: Final = (
    "\x00-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ufeff"
    "\U000e0000-\U000e007f\ud800-\udfff"
)
_LINE: Final = re.compile(f"[{_ACTING}]")
_TEXT: Final = re.compile(f"(?![\n\t])[{_ACTING}]")

# An escape inside a JSON string; a pair of surrogates is one character.
_JSON_ESCAPE: Final = re.compile(
    r"\\(?:u[dD][89abAB][0-9a-fA-F]{2}\\u[dD][c-fC-F][0-9a-fA-F]{2}|u([0-9a-fA-F]{4})|.)"
)

# The byte b of a file name stands as U+DC00 + b (PEP 383).
_BYTES: Final = range(0xDC80, 0xDD00)


def visible(text: str) -> str:
    r"""Write control characters as escapes, such as ``\x1b``; the text is one line then."""
    return _LINE.sub(_escape, text)


def visible_text(text: str) -> str:
    """Write control characters as escapes but for ends of lines and tabulators."""
    return _TEXT.sub(_escape, text)


def visible_json(text: str) -> str:
    r"""Write control characters inside JSON as ``\u001b``: the same to whoever reads it."""
    return _TEXT.sub(_json_escape, text)


def shown_json(text: str) -> str:
    r"""Turn control characters inside JSON into their visible escapes: they are shown so."""
    return _TEXT.sub(_doubled, _JSON_ESCAPE.sub(_doubled_escape, text))


def plain_json(text: str) -> str:
    r"""Write all characters but ASCII inside JSON as ``\u00e9``."""
    return re.sub(r"[^\n\t\x20-\x7e]", _json_escape, text)


def cut(text: str, longest: int = LONGEST) -> str:
    """Cut a message to what a screen shows, and say how much is left out."""
    if len(text) <= longest:
        return text
    # Not longer than allowed with its note, so that a text that was cut is not cut again.
    room = max(longest - len(_left_out(len(text))), 3)
    tail = room // 3
    return text[: room - tail] + _left_out(len(text) - room) + text[-tail:]


def _left_out(count: int) -> str:
    return f" … ({count} characters left out) … "


def _escape(found: re.Match[str]) -> str:
    code = ord(found.group())
    if code in _BYTES:
        return f"\\x{code - 0xDC00:02x}"
    if code < 0x100:
        return {"\n": "\\n", "\r": "\\r", "\t": "\\t"}.get(found.group(), f"\\x{code:02x}")
    return f"\\u{code:04x}" if code < 0x10000 else f"\\U{code:08x}"


def _doubled(found: re.Match[str]) -> str:
    return "\\" + _escape(found)


def _doubled_escape(found: re.Match[str]) -> str:
    if found.group()[1] in "bfr":
        return "\\" + found.group()
    single = found.group(1)
    if single is None or _TEXT.fullmatch(chr(int(single, 16))) is None:
        return found.group()
    return "\\" + found.group()


def _json_escape(found: re.Match[str]) -> str:
    code = ord(found.group())
    if code < 0x10000:
        return f"\\u{code:04x}"
    code -= 0x10000
    return f"\\u{0xD800 + (code >> 10):04x}\\u{0xDC00 + (code & 0x3FF):04x}"
