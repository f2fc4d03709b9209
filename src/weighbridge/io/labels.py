"""Texts that a database or a log gives to single values of a signal, such as "SNA" or "Gear 2"."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Final

import numpy as np

from weighbridge.signals import Floats

_NO_VALUE: Final = re.compile(
    r"\b(sna|n/?a|nan|not?[ -]?(avail\w*|valid|defined|plausible|ready|initiali[sz]ed)"
    r"|un(avail\w*|defined|def|known|plausible|initiali[sz]ed)|signal[ ]?not[ ]?avail\w*"
    r"|no[ ]?(signal|data|value)([ ]?exists?)?|inv(alid)?"
    r"|init(iali[sz]\w*)?|reserved|missing|fault\w*|fail\w*"
    r"|err(or)?|defect\w*|timeout|ungueltig|ungültig|undefiniert|fehler|nicht[ ]?(verf\w*|defin\w*"
    r"|initialisiert))\b",
    re.IGNORECASE,
)
"""Texts of a value that is none."""

_NO_FAULT: Final = re.compile(r"^(no|kein)[ -]?(err|fault|fail|fehler)", re.IGNORECASE)

_NUMBER: Final = re.compile(r"^\D*?(\d+)\s?(st|nd|rd|th)?\b[^\d]*$", re.IGNORECASE)
"""The one whole number in a text, such as Gear2 and 3rd gear."""

_REST: Final = {
    0.0: re.compile(r"^(n|p|neutral|park\w*|leerlauf|none)\b", re.IGNORECASE),
    -1.0: re.compile(r"^(r|reverse|rückw\w*|rueckw\w*)\b", re.IGNORECASE),
}
"""What stands beside the numbers of gears."""


def is_no_value(text: str) -> bool:
    """Whether the text of a value says that there is none."""
    plain = re.sub(r"[_\s]+", " ", text).strip()
    return _NO_VALUE.search(plain) is not None and _NO_FAULT.match(plain) is None


def numbers_of(texts: Mapping[float, str]) -> dict[float, float]:
    """Numbers that values with a text stand for; NaN where the text says that there is none.

    Parameters
    ----------
    texts : by the raw value

    Returns
    -------
    By the raw value: the numbers in the texts where they count something, else the raw values.
    """
    found = {raw: number for raw, text in texts.items() if (number := _number(text)) is not None}
    counted = len(found) > 2 and len(set(found.values())) == len(found)
    values = {}
    for raw, text in texts.items():
        if is_no_value(text):
            values[raw] = float("nan")
        elif not counted:
            values[raw] = raw
        elif raw in found:
            values[raw] = found[raw]
        else:
            plain = text.strip()
            values[raw] = next((x for x, form in _REST.items() if form.match(plain)), float("nan"))
    return values


def _number(text: str) -> float | None:
    if is_no_value(text) or (found := _NUMBER.match(text.strip())) is None:
        return None
    return float(found.group(1))


def physical_of(raw: Floats, converted: np.ndarray) -> tuple[Floats, int]:
    """Numbers of a channel whose conversion gives texts, to some values or to all.

    Parameters
    ----------
    raw : (n,) as recorded
    converted : (n,) texts, as text or bytes; a number in place of one where a value has none

    Returns
    -------
    values : (n,) NaN where the text says that there is none
    lost : how many these are
    """
    kinds, first, place = np.unique(raw, return_index=True, return_inverse=True)
    values = np.full(kinds.size, np.nan)
    texts: dict[float, str] = {}
    for k, at in enumerate(first.tolist()):
        reported = converted[at]
        text = reported.decode("utf-8", "replace") if isinstance(reported, bytes) else str(reported)
        try:
            values[k] = float(text)
        except ValueError:
            # A value without a text of its own is what was recorded.
            texts[float(kinds[k])] = text
    named = numbers_of({raw: text for raw, text in texts.items() if text.strip()})
    for k, kind in enumerate(kinds.tolist()):
        if kind in texts:
            values[k] = named.get(kind, kind)
    out = values[place.reshape(-1)]
    return out, int(np.count_nonzero(np.isnan(out) & np.isfinite(raw)))
