"""A log format: lines of a time and a speed, with an exclamation mark between."""

import numpy as np

from weighbridge.io import Format, Takes
from weighbridge.io.log import Log
from weighbridge.signals import clean_columns


def read(path, table, mapping):
    """Return the log; values are SI: here m/s."""
    rows = np.array([line.split("!") for line in path.read_text().split()], float)
    log = Log(path)
    log.signals, log.problems = clean_columns(
        rows[:, 0], [("vehicle_speed", rows[:, 1])], path.name
    )
    return log


FORMAT = Format(
    name="Bang",
    suffixes=(".bang",),
    read=read,
    about="the speed, after an exclamation mark",
    takes=Takes.CLOCK,
)
