"""How much axes shake: block by block, and around each instant."""

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


@kernel
def widest_spread(values, half):
    """Return the largest standard deviation of several axes around each instant (n,).

    Parameters
    ----------
    values : (n, c) float64
        n > 0.
    half : int
        Samples on either side; beyond an end its sample is held.
    """
    count, width = values.shape[0], 2 * half + 1
    widest = np.zeros(count)
    for c in range(values.shape[1]):
        level, total, square = values[0, c], 0.0, 0.0
        for k in range(-half, count + half):
            here = values[min(max(k, 0), count - 1), c] - level
            total += here
            square += here * here
            if k >= half:
                mean = total / width
                spread = np.sqrt(max(square / width - mean * mean, 0.0))
                widest[k - half] = max(widest[k - half], spread)
                gone = values[max(k - 2 * half, 0), c] - level
                total -= gone
                square -= gone * gone
    return widest
