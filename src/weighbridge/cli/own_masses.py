"""The drives of a calibration, weighed with the file that it wrote."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from weighbridge.signals import Drive
    from weighbridge.vehicle.model import Vehicle


def own_mass_lines(
    car: Vehicle, drives: Sequence[Drive], progress: Callable[[int, int], None] | None = None
) -> Iterator[str]:
    """Say what each drive weighs with its own calibration, and what `weigh` would note of it.

    Parameters
    ----------
    car : as calibrated
    drives : of the calibration, in its order
    progress : told of drives weighed of all
    """
    from weighbridge.errors import WeighbridgeError
    from weighbridge.pipeline.weighing import DEFAULT_METHOD, weigh

    made = car.provenance
    yield "its own drives, weighed with it (they made it, so this is no proof of others):"
    for k, (drive, kg) in enumerate(zip(drives, made.masses, strict=True)):
        if progress is not None:
            progress(k, len(drives))
        try:
            own = weigh(drive, car, made.method or DEFAULT_METHOD)
        except WeighbridgeError as error:
            yield f"  {drive.name}: no mass: {error}"
            continue
        if own.status == "converged":
            low, high = (100.0 * (bound / kg - 1.0) for bound in own.interval(0.95))
            yield (
                f"  {drive.name}: {own.mass:.0f} kg, {100.0 * (own.mass / kg - 1.0):+.1f} % of the "
                f"{kg:.0f} kg known (95 % between {low:+.1f} and {high:+.1f} %)"
            )
        else:
            yield f"  {drive.name}: no mass ({own.status}): {own.reason}"
        for warning in own.warnings:
            if warning not in made.doubts:
                yield f"    note: {warning}"
