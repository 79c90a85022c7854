"""Compiled chains of arcs, for loops that evaluate one state at a time: the functions of `soro_lib.arcs`.

Nothing is written twice: numba compiles the very lines that carry a frame along an arc. One pose with its
Jacobian takes one to two microseconds.
"""

import numpy as np
from numba import njit

from soro_lib import arcs
from soro_lib.checks import Array

carry = njit(arcs.carry)
end_velocities = njit(arcs.end_velocities)
arc_numbers = njit(arcs.arc_numbers)
arc_slopes = njit(arcs.arc_slopes)


@njit(cache=True)
def frame_row(frame: Array, k: int) -> tuple[float, float, float, float]:
    """Return row ``k`` of a frame (3, 4) as the functions of `soro_lib.arcs` take it."""
    return frame[k, 0], frame[k, 1], frame[k, 2], frame[k, 3]


@njit(cache=True)
def carry_frame(frame: Array, arc: tuple[float, ...]) -> None:
    """Carry ``frame`` (3, 4), in place, from the start of an arc to its end."""
    for k in range(3):
        frame[k, 0], frame[k, 1], frame[k, 2], frame[k, 3] = carry(frame_row(frame, k), arc)


@njit(cache=True)
def frame_velocities(frame: Array, arc: tuple[float, ...], velocities: Array, first: int) -> None:
    """Write the velocities of the end of an arc that starts in ``frame``, by its dx, dy and length.

    They fill the columns ``first`` to ``first + 2`` of ``velocities`` (6, n). Rows: linear, then angular
    velocity, in the frame that ``frame`` is given in.
    """
    slopes = arc_slopes(arc)
    for k in range(3):
        along_x, along_y, along, turn_x, turn_y = end_velocities(frame_row(frame, k), arc, slopes)
        velocities[k, first], velocities[k, first + 1], velocities[k, first + 2] = along_x, along_y, along
        velocities[3 + k, first], velocities[3 + k, first + 1] = turn_x, turn_y
        velocities[3 + k, first + 2] = 0.0


@njit(cache=True)
def swing(velocities: Array, first: int, lever: tuple[float, float, float]) -> None:
    """Move three columns of ``velocities`` (6, n), in place, to a point of the body ``lever`` away."""
    for column in range(first, first + 3):
        turn_x, turn_y, turn_z = velocities[3, column], velocities[4, column], velocities[5, column]
        velocities[0, column] += turn_y * lever[2] - turn_z * lever[1]
        velocities[1, column] += turn_z * lever[0] - turn_x * lever[2]
        velocities[2, column] += turn_x * lever[1] - turn_y * lever[0]


@njit(cache=True)
def base_frame() -> Array:
    """Return the frame (3, 4) that a chain starts in."""
    frame = np.zeros((3, 4))
    frame[0, 0] = frame[1, 1] = frame[2, 2] = 1.0
    return frame


@njit(cache=True)
def chain_frame_and_jacobian(configuration: Array) -> tuple[Array, Array]:
    """Return the end frame (3, 4) and its Jacobian (6, 3 n) of a chain (n, 3) of (dx, dy, length).

    Equal to `soro_lib.arcs.chain_transform_and_jacobian`, without its checks.
    """
    count = configuration.shape[0]
    frame = base_frame()
    jacobian = np.empty((6, 3 * count))
    ends = np.empty((count, 3))
    for i in range(count):
        arc = arc_numbers(configuration[i, 0], configuration[i, 1], configuration[i, 2])
        frame_velocities(frame, arc, jacobian, 3 * i)
        carry_frame(frame, arc)
        for k in range(3):
            ends[i, k] = frame[k, 3]
    for i in range(count):
        lever = (frame[0, 3] - ends[i, 0], frame[1, 3] - ends[i, 1], frame[2, 3] - ends[i, 2])
        swing(jacobian, 3 * i, lever)
    return frame, jacobian
