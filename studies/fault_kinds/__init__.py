"""Every fault of the study, one function each, by group."""

from fault_kinds import clocks, engine, files, frozen, harmless, inertial
from fault_kinds.shaping import USUAL, Fault, Stage

FAULTS: tuple[Fault, ...] = (
    *clocks.FAULTS,
    *frozen.FAULTS,
    *engine.FAULTS,
    *inertial.FAULTS,
    *files.FAULTS,
    *harmless.FAULTS,
)

__all__ = ["FAULTS", "USUAL", "Fault", "Stage"]
