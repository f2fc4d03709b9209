"""Names whose modules are imported when they are first used."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any


def at_first_use(package: str, homes: Mapping[str, str]) -> Callable[[str], Any]:
    """Return the ``__getattr__`` of a package, so that importing the package costs nothing.

    Parameters
    ----------
    package : its name
    homes : module of each public name; of a public module the module itself
    """

    def found(name: str) -> Any:
        home = homes.get(name)
        if home is None:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        module = import_module(home)
        return module if home == f"{package}.{name}" else getattr(module, name)

    return found


def at_first_uses(
    package: str, homes: Mapping[str, str]
) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """Return ``__getattr__``, ``__dir__`` and ``__all__`` of a package of public names.

    Parameters
    ----------
    package : its name
    homes : public names of each of its modules, parted by blanks
    """
    found = {
        name: f"{package}.{module}" for module, names in homes.items() for name in names.split()
    }
    return at_first_use(package, found), lambda: sorted(found), sorted(found)


def at_first_call(path: str) -> Callable[..., Any]:
    """Return a function, or a class to call, whose module is imported when it is first called.

    Parameters
    ----------
    path : of the function: package, module and name, with dots
    """
    home, _, name = path.rpartition(".")

    def call(*given: Any, **named: Any) -> Any:
        return getattr(import_module(home), name)(*given, **named)

    call.__module__, call.__name__, call.__qualname__ = home, name, name
    return call
