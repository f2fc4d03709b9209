"""What is installed: this program, the packages it needs, its extras and its compiled kernels."""

from __future__ import annotations

import os
import pkgutil
import platform
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from importlib import import_module, metadata
from pathlib import Path
from types import ModuleType
from typing import Any, Final

from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet

import weighbridge

EXTRAS: Final[Mapping[str, str]] = {
    "formats": "all log formats below",
    "mdf": "MF4 logs",
    "can": "raw CAN logs, DBC",
    "position": "NMEA and GPX logs",
    "mat": "MATLAB files",
    "hdf5": "HDF5 files",
    "tdms": "TDMS files",
    "ros": "ROS bags, MCAP",
    "openpilot": "openpilot logs",
    "elevation": "elevation rasters",
    "live": "adapters, CAN, GNSS",
    "ble": "Bluetooth adapters",
    "mqtt": "sending to a broker",
    "page": "page of live weighings",
    "fleet": "drives in parallel",
    "s3": "drives in S3",
    "fleet-delta": "Delta tables",
}
"""Extras for users, and what each is for; those of developers are not among them."""

_NAME: Final = "weighbridge"


@dataclass(frozen=True, slots=True)
class Package:
    """A package that is needed.

    Attributes
    ----------
    name : as the registry of packages calls it
    wanted : versions that do, such as ``>=1.0``
    installed : version that is there; None where none is
    """

    name: str
    wanted: str
    installed: str | None

    @property
    def fits(self) -> bool:
        """Whether a version that does is there."""
        return self.installed is not None and SpecifierSet(self.wanted).contains(
            self.installed, prereleases=True
        )

    @property
    def reported(self) -> str:
        """What is wrong with it, in a few words; empty where nothing is."""
        if self.fits:
            return ""
        if self.installed is None:
            return f"{self.name} is missing"
        return f"{self.name} {self.installed} does not fit {self.wanted}"


@dataclass(frozen=True, slots=True)
class Extra:
    """An extra, its purpose and its packages."""

    name: str
    purpose: str
    packages: tuple[Package, ...]

    @property
    def fits(self) -> bool:
        """Whether all its packages are there."""
        return all(package.fits for package in self.packages)


@dataclass(frozen=True, slots=True)
class KernelCache:
    """Compiled kernels on the disk.

    Attributes
    ----------
    folder : where they are kept; None where they are not
    writable : whether new ones can be kept
    size : of their files [B]
    compiled : kernels that are there, of these sources and for this processor
    kernels : kernels that there are
    why : kernels are not kept, in a sentence; empty where they are
    """

    folder: Path | None = None
    writable: bool = False
    size: int = 0
    compiled: int = 0
    kernels: int = 0
    why: str = ""


@dataclass(frozen=True, slots=True)
class Installation:
    """All that `weighbridge doctor` shows."""

    version: str
    folder: Path
    python: str
    implementation: str
    wanted_python: str
    system: str
    cores: int
    packages: tuple[Package, ...]
    extras: tuple[Extra, ...]
    cache: KernelCache

    @property
    def amiss(self) -> list[str]:
        """What keeps the program from working as it should, each with its remedy."""
        found = [
            f'{package.reported}: pip install "{package.name}{package.wanted}"'
            for package in self.packages
            if not package.fits
        ]
        if self.wanted_python and not SpecifierSet(self.wanted_python).contains(self.python):
            found.append(f"Python {self.python} does not fit {self.wanted_python}: use another")
        unfit = {
            package.name: f'{package.reported}: pip install "{package.name}{package.wanted}"'
            for extra in self.extras
            for package in extra.packages
            if package.installed is not None and not package.fits
        }
        return [*found, *unfit.values(), *([self.cache.why] if self.cache.why else [])]

    @property
    def missing(self) -> tuple[str, ...]:
        """Extras of which something is not installed."""
        return tuple(extra.name for extra in self.extras if not extra.fits)

    def as_dict(self) -> dict[str, Any]:
        """Return what JSON is made of."""
        return {
            "weighbridge": self.version,
            "folder": str(self.folder),
            "python": self.python,
            "implementation": self.implementation,
            "requires_python": self.wanted_python,
            "system": self.system,
            "cores": self.cores,
            "packages": [_row(package) for package in self.packages],
            "extras": [
                {
                    "name": extra.name,
                    "purpose": extra.purpose,
                    "complete": extra.fits,
                    "packages": [_row(package) for package in extra.packages],
                    "install": f'pip install "{_NAME}[{extra.name}]"',
                }
                for extra in self.extras
            ],
            "cache": {
                "folder": None if self.cache.folder is None else str(self.cache.folder),
                "writable": self.cache.writable,
                "size_bytes": self.cache.size,
                "compiled": self.cache.compiled,
                "kernels": self.cache.kernels,
            },
            "missing_extras": list(self.missing),
            "amiss": self.amiss,
        }


def examine() -> Installation:
    """Look at the installation, without changing it."""
    wanted = requirements()
    try:
        python = str(metadata.metadata(_NAME).json.get("requires_python", ""))
    except metadata.PackageNotFoundError:
        python = ""
    needed = tuple(map(_found, wanted.get("", ())))
    return Installation(
        version=weighbridge.__version__,
        folder=Path(weighbridge.__file__).parent,
        python=platform.python_version(),
        implementation=platform.python_implementation(),
        wanted_python=python,
        system=f"{platform.system()} {platform.machine()}",
        cores=os.cpu_count() or 1,
        packages=needed,
        extras=tuple(
            Extra(name, purpose, tuple(map(_found, wanted[name])))
            for name, purpose in EXTRAS.items()
            if name in wanted
        ),
        cache=_cache() if all(package.fits for package in needed) else KernelCache(),
    )


def requirements() -> dict[str, tuple[Requirement, ...]]:
    """Packages that the program needs, under an empty name, and those of each of its extras.

    Nothing is known where the program runs without being installed.
    """
    try:
        own = metadata.metadata(_NAME)
        lines = [Requirement(line) for line in metadata.requires(_NAME) or ()]
    except metadata.PackageNotFoundError:
        return {}
    plain = [line for line in lines if line.marker is None or line.marker.evaluate({"extra": ""})]
    found = {"": tuple(plain)}
    stated = {
        extra: [
            line
            for line in lines
            if line not in plain
            and line.marker is not None
            and line.marker.evaluate({"extra": extra})
        ]
        for extra in own.get_all("Provides-Extra") or ()
    }
    for extra in stated:
        every = {line.name: line for line in _resolved(extra, stated)}
        found[extra] = tuple(every.values())
    return found


def _resolved(extra: str, stated: Mapping[str, list[Requirement]]) -> Iterator[Requirement]:
    """Yield the packages of an extra, those of the extras that it names included."""
    for line in stated[extra]:
        if line.name == _NAME:
            for inner in sorted(line.extras):
                yield from _resolved(inner, stated)
        else:
            yield line


def _found(wanted: Requirement) -> Package:
    try:
        installed = metadata.version(wanted.name)
    except metadata.PackageNotFoundError:
        installed = None
    return Package(wanted.name, str(wanted.specifier), installed)


def _row(package: Package) -> dict[str, Any]:
    return {**asdict(package), "fits": package.fits}


def _cache() -> KernelCache:
    """Look where the kernels are kept, and how many of them are."""
    from weighbridge import kernels

    names = [found.name for found in pkgutil.iter_modules(kernels.__path__)]
    modules = [import_module(f"{kernels.__name__}.{name}") for name in sorted(names)]
    caches = [kernel._cache for module in modules for kernel in _kernels(module)]
    if not caches:
        return KernelCache(why="kernels are not compiled at all: unset NUMBA_DISABLE_JIT")
    kept = [cache for cache in caches if getattr(cache, "cache_path", None)]
    if not kept:
        return KernelCache(
            kernels=len(caches),
            why="compiled kernels are not kept, so that each run compiles: name a folder that can "
            "be written to in NUMBA_CACHE_DIR",
        )
    folder = Path(kept[0].cache_path)
    files = [file for pattern in ("*.nbi", "*.nbc") for file in folder.glob(pattern)]
    writable = _writable(folder)
    return KernelCache(
        folder,
        writable,
        sum(file.stat().st_size for file in files),
        sum(map(_is_compiled, kept)),
        len(caches),
        ""
        if writable
        else f"{folder}: cannot be written to, so that each run compiles; name another folder in "
        "NUMBA_CACHE_DIR",
    )


def _kernels(module: ModuleType) -> Iterator[Any]:
    """Yield the kernels of a module that are compiled by themselves."""
    for kernel in vars(module).values():
        function = getattr(kernel, "py_func", None)
        if function is None or function.__module__ != module.__name__:
            continue
        # Those put in the place of their calls have no code of their own.
        if kernel.targetoptions.get("inline") != "always":
            yield kernel


def _is_compiled(cache: Any) -> bool:
    """Say whether a kernel is on the disk, of its present source and for this processor."""
    from numba.core.registry import cpu_target

    try:
        overloads = cache._cache_file._load_index()
    # A file cut off is a pickle cut off, whose errors are of many kinds.
    except Exception:
        return False
    here = cpu_target.target_context.codegen().magic_tuple()
    return any(key[1] == here for key in overloads)


def _writable(folder: Path) -> bool:
    """Say whether a folder can be written to, or made."""
    while not folder.exists() and folder != folder.parent:
        folder = folder.parent
    return os.access(folder, os.W_OK)
