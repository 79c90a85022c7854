"""Compiled chains of arcs, for loops that evaluate one state at a time: the functions of `soro_lib.arcs`.

Nothing is written twice: numba compiles the very lines that carry a frame along an arc. One pose with its
Jacobian takes one to two microseconds.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from soro_lib import arcs

Array = NDArray[np.float64]

carry = njit(arcs.carry)
end_velocities = njit(arcs.end_velocities)
arc_numbers = njit(arcs.arc_numbers)
arc_slopes = njit(arcs.arc_slopes)


@njit(cache=True)
def carry_frame(frame: Array, arc: tuple[float, ...]) -> Array:
    """Return the frame (3, 4) at the end of an arc that starts in ``frame``."""
    end = np.empty((3, 4))
    for k in range(3):
        end[k, 0], end[k, 1], end[k, 2], end[k, 3] = carry(
            (frame[k, 0], frame[k, 1], frame[k, 2], frame[k, 3]), arc
        )
    return end


@njit(cache=True)
def frame_velocities(frame: Array, arc: tuple[float, ...]) -> Array:
    """Return the velocities (6, 3) of the end of an arc that starts in ``frame``, by its dx, dy and length.

    Rows: linear, then angular velocity, in the frame that ``frame`` is given in.
    """
    slopes = arc_slopes(arc)
    velocities = np.zeros((6, 3))
    for k in range(3):
        row = (frame[k, 0], frame[k, 1], frame[k, 2], frame[k, 3])
        along_x, along_y, along, turn_x, turn_y = end_velocities(row, arc, slopes)
        velocities[k, 0], velocities[k, 1], velocities[k, 2] = along_x, along_y, along
        velocities[3 + k, 0], velocities[3 + k, 1] = turn_x, turn_y
    return velocities


@njit(cache=True)
def swing(velocities: Array, lever: Array) -> None:
    """Move the columns of ``velocities`` (6, n), in place, to a point of the body ``lever`` (3,) away."""
    for column in range(velocities.shape[1]):
        turn_x, turn_y, turn_z = velocities[3, column], velocities[4, column], velocities[5, column]
        velocities[0, column] += turn_y * lever[2] - turn_z * lever[1]
        velocities[1, column] += turn_z * lever[0] - turn_x * lever[2]
        velocities[2, column] += turn_x * lever[1] - turn_y * lever[0]


@njit(cache=True)
def chain_frame_and_jacobian(configuration: Array) -> tuple[Array, Array]:
    """Return the end frame (3, 4) and its Jacobian (6, 3 n) of a chain (n, 3) of (dx, dy, length).

    Equal to `soro_lib.arcs.chain_transform_and_jacobian`, without its checks.
    """
    count = configuration.shape[0]
    frame = np.zeros((3, 4))
    frame[0, 0] = frame[1, 1] = frame[2, 2] = 1.0
    jacobian = np.empty((6, 3 * count))
    ends = np.empty((count, 3))
    for i in range(count):
        arc = arc_numbers(configuration[i, 0], configuration[i, 1], configuration[i, 2])
        jacobian[:, 3 * i : 3 * i + 3] = frame_velocities(frame, arc)
        frame = carry_frame(frame, arc)
        ends[i] = frame[:, 3]
    for i in range(count):
        swing(jacobian[:, 3 * i : 3 * i + 3], frame[:, 3] - ends[i])
    return frame, jacobian
