"""The drives of a calibration, weighed with the file that it wrote."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from weighbridge.messages import Problem
    from weighbridge.pipeline.weighing import Weighing
    from weighbridge.signals import Drive
    from weighbridge.vehicle import Vehicle


@dataclass(frozen=True)
class OwnMasses:
    """What the drives of a calibration weigh by its file.

    Attributes
    ----------
    lines : what each drive weighs, and what `weigh` would note of it
    unweighed : drives that have no mass, with the reason, in their order
    drives : how many were weighed or not
    outside : drives whose known mass lies outside the interval, with what it weighs, in their order
    """

    lines: tuple[str, ...]
    unweighed: tuple[tuple[str, str], ...]
    drives: int
    outside: tuple[tuple[str, str], ...] = ()

    @property
    def useless(self) -> bool:
        """Whether the file weighs none of the drives it was made from."""
        return len(self.unweighed) == self.drives

    @property
    def doubt(self) -> Problem | None:
        """What is to be said of the file; None where it weighs all of its drives."""
        from weighbridge.messages import Problem

        if not self.unweighed:
            return self._contradiction
        name, reason = self.unweighed[0]
        about: dict[str, Any] = {"drive": name, "reason": reason}
        if not self.useless:
            return Problem.of(
                "calibration.some_unweighed",
                **about,
                count=len(self.unweighed),
                drives=self.drives,
            )
        alone = self.drives == 1
        which = "calibration.own_unweighed" if alone else "calibration.all_unweighed"
        return Problem.of(which, **about)

    @property
    def _contradiction(self) -> Problem | None:
        """What speaks against a known mass; None where all lie within their intervals."""
        from weighbridge.messages import Problem

        if not self.outside:
            return None
        name, words = self.outside[0]
        return Problem.of(
            "calibration.outside",
            count=len(self.outside),
            drives=self.drives,
            drive=name,
            words=words,
        )


def own_masses(
    car: Vehicle, drives: Sequence[Drive], progress: Callable[[int, int], None] | None = None
) -> OwnMasses:
    """Weigh each drive with its own calibration.

    Parameters
    ----------
    car : as calibrated
    drives : of the calibration, in its order
    progress : reported of drives weighed of all
    """
    from weighbridge.errors import WeighbridgeError
    from weighbridge.pipeline.weighing import DEFAULT_METHOD, weigh

    made = car.provenance
    lines = ["its own drives, weighed with it (they made it, so this is no proof of others):"]
    unweighed, outside = [], []
    for k, (drive, kg) in enumerate(zip(drives, made.masses, strict=True)):
        if progress is not None:
            progress(k, len(drives))
        try:
            own = weigh(drive, car, made.method or DEFAULT_METHOD)
        except WeighbridgeError as error:
            lines.append(f"  {drive.name}: no mass: {error}")
            unweighed.append((drive.name, str(error)))
            continue
        if own.status == "converged":
            low, high = (100.0 * (bound / kg - 1.0) for bound in own.interval(0.95))
            lines.append(
                f"  {drive.name}: {own.mass:.0f} kg, {100.0 * (own.mass / kg - 1.0):+.1f} % of the "
                f"{kg:.0f} kg known (95 % between {low:+.1f} and {high:+.1f} %)"
            )
            if not low <= 0.0 <= high:
                outside.append((drive.name, _words(own, kg)))
        else:
            lines.append(f"  {drive.name}: no mass ({own.status}): {own.reason}")
            unweighed.append((drive.name, own.reason))
        lines += [f"    note: {p.text}" for p in own.problems if p.line not in made.doubts]
    return OwnMasses(tuple(lines), tuple(unweighed), len(drives), tuple(outside))


def _words(own: Weighing, known: float) -> str:
    """Say what a drive weighs, and the loads that it seems to have had."""
    reported = f"{own.mass:.0f} kg in place of {known:.0f} kg"
    if not own.load_changed:
        return reported
    loads = ", ".join(f"{part.mass:.0f}" for part in own.segments)
    return f"{reported}; its load seems to change: {loads} kg in turn"
