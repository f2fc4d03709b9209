"""State of a live scale as text: written once a minute, read after a power cut.

Numbers go bit by bit, so that a scale which was restored weighs on as if nothing had been. Only
records and tuples of this package are made from the text; it can run nothing.
"""

from __future__ import annotations

import base64
import hashlib
import json
from dataclasses import fields, is_dataclass
from enum import Enum
from importlib import import_module
from typing import Any, Final

import numpy as np

from weighbridge.arguments import check_text
from weighbridge.errors import ConfigError
from weighbridge.pipeline.forward import ForwardSetup, ForwardState
from weighbridge.vehicle import Vehicle

VERSION: Final = 13
"""Of the layout; another one is refused."""

LIGHTEST, HEAVIEST = 50.0, 200e3
"""Masses that road vehicles have [kg]."""

_ROOT: Final = "weighbridge."
_MOST: Final = 64 * 2**20
"""No checkpoint is so long [B]."""


def fingerprint(vehicle: Vehicle) -> str:
    """Return a short text that is another one for any other vehicle file."""
    return hashlib.sha256(json.dumps(_plain(vehicle)).encode()).hexdigest()[:16]


def packed(content: object, vehicle: Vehicle) -> str:
    """Write a content of numbers, arrays, records and tuples as text.

    Parameters
    ----------
    content : of this package's dataclasses and named tuples, and of builtin types
    vehicle : it holds for
    """
    body = json.dumps(_plain(content), separators=(",", ":"))
    head = {
        "weighbridge_checkpoint": VERSION,
        "vehicle": fingerprint(vehicle),
        "sha256": hashlib.sha256(body.encode()).hexdigest(),
    }
    return json.dumps(head) + "\n" + body


def unpacked(text: str, vehicle: Vehicle) -> Any:
    """Read a content back.

    Raises
    ------
    ConfigError
        The text is damaged, of another version or of another vehicle file.
    """
    check_text("checkpoint", text)
    refused = "the checkpoint is not used"
    if len(text) > _MOST:
        raise ConfigError(f"{refused}: it has {len(text)} letters, more than any of ours")
    try:
        first, body = text.split("\n", 1)
        head = json.loads(first)
        version, of = head["weighbridge_checkpoint"], head["vehicle"]
        whole = hashlib.sha256(body.encode(errors="replace")).hexdigest() == head["sha256"]
    except (ValueError, KeyError, TypeError, RecursionError):
        raise ConfigError(f"{refused}: it is damaged") from None
    if version != VERSION:
        raise ConfigError(f"{refused}: it has version {version}, and this program {VERSION}")
    if not whole:
        raise ConfigError(f"{refused}: it is damaged")
    if of != fingerprint(vehicle):
        raise ConfigError(f"{refused}: it was made with another vehicle file")
    try:
        return _made(json.loads(body))
    except (ValueError, KeyError, TypeError, AttributeError, ImportError, RecursionError) as error:
        raise ConfigError(f"{refused}: {error}") from None


def refuse_absurd(state: ForwardState | None, setup: ForwardSetup | None) -> None:
    """Refuse a state with a mass that no vehicle has.

    Raises
    ------
    ConfigError
        The sentence names it.
    """
    if state is None or setup is None or not state.joint.windows:
        return
    mass, std = state.joint.mass, state.joint.std(setup.joint)
    if not (LIGHTEST < mass < HEAVIEST and 0.0 < std < mass):
        raise ConfigError(f"the checkpoint is not used: it holds {mass:.0f} kg, std {std:.0f} kg")


def _plain(value: Any) -> Any:
    """Turn a value into what JSON carries, types named."""
    if value is None or (isinstance(value, bool | str | int) and not isinstance(value, Enum)):
        return value
    if isinstance(value, float | np.floating):
        return {"f": float(value).hex()}
    if isinstance(value, np.integer | np.bool_):
        return value.item()
    if isinstance(value, np.ndarray):
        text = base64.b64encode(np.ascontiguousarray(value).tobytes()).decode()
        return {"a": text, "t": value.dtype.str, "s": list(value.shape)}
    if isinstance(value, Enum):
        return {"e": _name(type(value)), "v": value.value}
    if is_dataclass(value) and not isinstance(value, type):
        parts = {f.name: _plain(getattr(value, f.name)) for f in fields(value) if f.init}
        return {"c": _name(type(value)), "v": parts}
    if isinstance(value, tuple) and hasattr(value, "_fields"):
        return {"n": _name(type(value)), "v": [_plain(v) for v in value]}
    if isinstance(value, tuple | list):
        return {"l" if isinstance(value, list) else "u": [_plain(v) for v in value]}
    if hasattr(value, "items"):
        return {"d": [[_plain(k), _plain(v)] for k, v in value.items()]}
    raise TypeError(f"{type(value).__name__} cannot be written to a checkpoint")


def _made(value: Any) -> Any:
    """Make a value of what `_plain` wrote."""
    if not isinstance(value, dict):
        return value
    if "f" in value:
        return float.fromhex(value["f"])
    if "a" in value:
        kind = np.dtype(value["t"])
        if kind.kind not in "fiub":
            raise ValueError(f"an array of {kind} is none of ours")
        raw = np.frombuffer(base64.b64decode(value["a"], validate=True), kind)
        return raw.reshape(value["s"]).copy()
    if "e" in value:
        return _type(value["e"])(value["v"])
    if "c" in value:
        return _type(value["c"])(**{k: _made(v) for k, v in value["v"].items()})
    if "n" in value:
        return _type(value["n"])(*(_made(v) for v in value["v"]))
    if "d" in value:
        return {_made(k): _made(v) for k, v in value["d"]}
    if "u" in value:
        return tuple(_made(v) for v in value["u"])
    return [_made(v) for v in value["l"]]


def _name(kind: type) -> str:
    return f"{kind.__module__}:{kind.__qualname__}"


def _type(name: str) -> Any:
    """Find a record, a named tuple or an enumeration of this package by name."""
    module, _, qualname = name.partition(":")
    if not module.startswith(_ROOT) or not qualname.isidentifier():
        raise ValueError(f"{name} is no record of this package")
    kind = getattr(import_module(module), qualname)
    record = isinstance(kind, type) and (
        is_dataclass(kind) or issubclass(kind, Enum) or (issubclass(kind, tuple))
    )
    if not record or not kind.__module__.startswith(_ROOT):
        raise ValueError(f"{name} is no record of this package")
    return kind
