"""How much an axis shakes beside its moving mean, block by block."""

import numpy as np

from weighbridge.kernels._jit import kernel


@kernel
def shaking(time, values, speed_time, speed, fast, width, start, block, count):
    """Sum the squares of an axis beside its mean over ``width`` samples, where a vehicle is fast.

    Parameters
    ----------
    time, values : (n,) float64
        Of the axis, n >= width > 1; times rise.
    speed_time, speed : (m,) float64
        Of the vehicle, m > 1; times rise.
    fast : float
        A slower vehicle does not count [m/s].
    width : int
    start, block : float
        Begin of the first block, and length of each [s].
    count : int
        Of the blocks.

    Returns
    -------
    square, samples : (count,) float64
    """
    square, samples = np.zeros(count), np.zeros(count)
    level, total, row = values[0], 0.0, 0
    for k in range(width - 1):
        total += values[k] - level
    for k in range(width - 1, time.size):
        total += values[k] - level
        middle = k - width + 1 + width // 2
        at = time[middle]
        while row + 2 < speed_time.size and speed_time[row + 1] <= at:
            row += 1
        part = (at - speed_time[row]) / (speed_time[row + 1] - speed_time[row])
        part = min(max(part, 0.0), 1.0)
        if speed[row] + part * (speed[row + 1] - speed[row]) > fast:
            beside = values[middle] - level - total / width
            place = int((at - start) / block)
            square[place] += beside * beside
            samples[place] += 1.0
        total -= values[k - width + 1] - level
    return square, samples
