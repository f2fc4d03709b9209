"""Limits that many checks share: of speed, of certainty, and of the number of samples."""

from typing import Final

STANDS: Final = 0.5
"""Slower, a vehicle stands [m/s]."""

MOVES: Final = 1.0
"""Faster, wheels, body and torque show the motion [m/s]. Slower, a speed in steps changes by leaps,
and a sensor may well repeat itself."""

CREEPS: Final = 2.0
"""Slower, a vehicle may creep or be pushed, and its torque shows little of the motion [m/s]."""

DRIVES: Final = 3.0
"""Faster, clutch and converter hardly slip, and a vehicle is driven [m/s]."""

LOCKED: Final = 6.0
"""Faster, clutch and converter are locked, in front of a stepless gearbox too [m/s]: they lock by
20 km/h."""

POSSIBLE: Final = 2.0
"""Standard deviations from which a difference is questioned [-]: of normal values one in 22 is
farther off."""

SIGNIFICANT: Final = 3.0
"""Standard deviations from which a difference is real [-]: of normal values one in 370 is farther
off."""

SURE: Final = 4.0
"""The same where many differences are looked at, or a mass is refused by one [-]: one in 16 000."""

CERTAIN: Final = 5.0
"""The same where errors last longer than their standard deviation allows for [-]: one in 1.7
million."""

PARTS: Final = 12
"""Parts of a drive that are left out one after another to find a standard deviation."""

FEW: Final = 10
"""Fewer samples show no median."""

SOME: Final = 30
"""Fewer samples, or means of them, show no mean and its scatter."""

MANY: Final = 100
"""Fewer samples show no share, ratio or curve."""

FEWEST_BLOCKS: Final = 5
"""Fewer blocks of a drive show no standard deviation."""

FEWEST_PIECES: Final = 4
"""Fewer pieces of a drive show no change over it."""
