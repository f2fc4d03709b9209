"""Sensors that no column of a log was taken for, though some look as if they were theirs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

from weighbridge.io.draft import Draft
from weighbridge.io.draft_column import CALCULATED
from weighbridge.io.naming import words_of
from weighbridge.io.table import column_list

_LOOKS: Final[tuple[tuple[str, tuple[str, ...], frozenset[str]], ...]] = (
    (
        "the accelerometer",
        ("accel_x", "accel_y", "accel_z", "longitudinal_accel"),
        frozenset(
            ("acc", "accel", "accl", "accelerometer", "acceleration", "acx", "acy", "acz", "gforce",
             "beschleunigung", "aceleracion", "accelerazione", "versnelling", "przyspieszenie")
        ),
    ),
    (
        "the gyroscope",
        ("gyro_x", "gyro_y", "gyro_z"),
        frozenset(
            ("gyr", "gyro", "gyroscope", "giroscopio", "drehrate", "rotation", "rot", "gyx", "gyy",
             "gyz", "zyro")
        ),
    ),
    (
        "the engine speed",
        ("engine_speed",),
        frozenset(
            ("rpm", "rev", "revs", "drehzahl", "motordrehzahl", "toerental", "giri", "obroty",
             "otacky", "varvtal", "devir", "devri", "regime", "regimen", "ne", "nmot", "engspd",
             "enginespeed", "enginerpm", "rotmoteur")
        ),
    ),
)  # fmt: skip
"""What a drive is weighed by, its quantities, and words that a column of it has in its name."""

_WITHOUT_GRAVITY: Final = frozenset(("linear", "user", "free", "liniowe")) | CALCULATED
"""Words of an acceleration that has no gravity in it."""

_SHOWN: Final = 4
"""Columns named at most."""


def missing(drafts: Sequence[Draft]) -> Iterator[str]:
    """Say of which sensor no column was taken, though columns that were not taken look like it.

    Parameters
    ----------
    drafts : of all files of a drive
    """
    known = {c.quantity for one in drafts for c in one.known}
    known |= frozenset().union(*(one.read_anyway for one in drafts))
    left = [(one, c.name) for one in drafts for c in one.columns if not c.quantity]
    for what, quantities, words in _LOOKS:
        if known & set(quantities):
            continue
        alike = [(one, name) for one, name in left if words & set(words_of(name))]
        if not alike:
            continue
        names = column_list(dict.fromkeys(name for _, name in alike), _SHOWN)
        of = f"no column of {alike[0][0].path.name} was taken for {what}"
        if all(_WITHOUT_GRAVITY & set(words_of(name)) for _, name in alike):
            yield f"{of}: {names} have no gravity in them; record the raw accelerometer"
            continue
        yield (
            f"{of}, though {names} may be its: if so, name it in the mapping as "
            f"{' or '.join(quantities[:3])}, with its unit"
        )
