"""Compiled kinematics of the cable-driven arm: positions, pointing direction and all Jacobians in one call.

The same model as :class:`soro_lib.robots.CableDrivenArm` (tested equal to it), for loops that run at the rate
of the sensor. Lai et al., Eqs. (1)-(3), (22)-(25).
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from soro_lib.arc_kernels import chain_frame_and_jacobian, swing
from soro_lib.arcs import chain_jacobian, chain_transform
from soro_lib.robots.base import Robot
from soro_lib.robots.cable_driven import CableDrivenArm

Array = NDArray[np.float64]


class Kinematics(NamedTuple):
    """Where the arm is and how it moves.

    Attributes
    ----------
    tip, mid : ndarray (3,)
        Frames {T} and {M} [m].
    direction : ndarray (3,)
        Pointing direction of the tip, a unit vector.
    tip_jacobian, mid_jacobian, direction_jacobian : ndarray (3, n)
        Derivatives by the actuation.
    """

    tip: Array
    mid: Array
    direction: Array
    tip_jacobian: Array
    mid_jacobian: Array
    direction_jacobian: Array


def compiled_kinematics(arm: CableDrivenArm) -> Callable[[Array], Kinematics]:
    """Return the compiled kinematics of one arm: actuation (7,) to :class:`Kinematics`; limits are not
    checked.

    Parameters
    ----------
    arm : CableDrivenArm
        Its parameters are frozen into the result.
    """
    force_slope, moment_slope = arm.load_slopes
    load_slopes = np.concatenate([force_slope[:, np.newaxis], moment_slope], axis=1)
    parameters = np.array([arm.segment_length, arm.axial_stiffness, arm.bending_rigidity, arm.cap_length])

    def kinematics(actuation: Array) -> Kinematics:
        return Kinematics(*_kinematics(actuation, load_slopes, parameters))

    return kinematics


def generic_kinematics(robot: Robot) -> Callable[[Array], Kinematics]:
    """Return the kinematics of any arm through the public robot interface.

    {M} is the middle of the chain of pieces. Slower than the compiled form, same result.
    """

    def kinematics(actuation: Array) -> Kinematics:
        pieces, slope = robot.configuration(actuation), robot.configuration_jacobian(actuation)
        pose, jacobian = chain_transform(pieces), chain_jacobian(pieces) @ slope
        middle = (len(pieces) + 1) // 2
        mid_jacobian = chain_jacobian(pieces[:middle])[:3] @ slope[: 3 * middle]
        direction = pose[:3, 2]
        turn = np.cross(jacobian[3:].T, direction).T
        mid = chain_transform(pieces[:middle])[:3, 3]
        return Kinematics(pose[:3, 3], mid, direction, jacobian[:3], mid_jacobian, turn)

    return kinematics


@njit(cache=True)
def _kinematics(
    q: Array, load_slopes: Array, parameters: Array
) -> tuple[Array, Array, Array, Array, Array, Array]:
    """Return tip, mid and direction (3,) and their Jacobians (3, 7)."""
    cap = parameters[3]
    soft, soft_slope = _soft_segments(q, load_slopes, parameters)
    step = 2 if cap > 0 else 1  # a cap is a straight piece after each soft one
    pieces = np.zeros((2 * step, 3))
    for k in range(3):
        pieces[0, k], pieces[step, k] = soft[0, k], soft[1, k]
    if cap > 0:
        pieces[1, 2] = pieces[3, 2] = cap
    mid_frame, mid_velocities = chain_frame_and_jacobian(pieces[:step])
    tip_frame, tip_velocities = chain_frame_and_jacobian(pieces)
    mid_frame[2, 3] += q[0]
    tip_frame[2, 3] += q[0]
    turning = tip_velocities.copy()
    for row in range(3):
        for column in range(6 * step):
            turning[row, column] = 0.0
    for piece in range(2 * step):
        swing(turning, 3 * piece, (tip_frame[0, 2], tip_frame[1, 2], tip_frame[2, 2]))
    tip_jacobian, mid_jacobian = np.zeros((3, 7)), np.zeros((3, 7))
    direction_jacobian = np.zeros((3, 7))
    tip_jacobian[2, 0] = mid_jacobian[2, 0] = 1.0
    for row in range(3):
        for column in range(1, 7):
            for u in range(3):
                proximal, distal = soft_slope[u, column], soft_slope[3 + u, column]
                tip_jacobian[row, column] += (
                    tip_velocities[row, u] * proximal + tip_velocities[row, 3 * step + u] * distal
                )
                mid_jacobian[row, column] += mid_velocities[row, u] * proximal
                direction_jacobian[row, column] += (
                    turning[row, u] * proximal + turning[row, 3 * step + u] * distal
                )
    tip, mid, direction = np.empty(3), np.empty(3), np.empty(3)
    for row in range(3):
        tip[row], mid[row], direction[row] = tip_frame[row, 3], mid_frame[row, 3], tip_frame[row, 2]
    return tip, mid, direction, tip_jacobian, mid_jacobian, direction_jacobian


@njit(cache=True)
def _soft_segments(q: Array, load_slopes: Array, parameters: Array) -> tuple[Array, Array]:
    """Return the soft segments (2, 3) as (dx, dy, length) and their slope (6, 7) by the actuation.

    What `CableDrivenArm.segments` does with `CableDrivenArm.load_slopes`; here force and moments of a segment
    are the rows of ``load_slopes`` (2, 3, 7).
    """
    length, stiffness, rigidity, _ = parameters
    soft, slope = np.empty((2, 3)), np.empty((6, 7))
    for k in range(2):
        load = np.zeros(3)
        for column in range(1, 7):
            for row in range(3):
                load[row] += load_slopes[k, row, column] * q[column]
        soft[k, 2] = length - load[0] / stiffness
        for axis in range(2):
            soft[k, axis] = load[1 + axis] * soft[k, 2] / rigidity
        for column in range(7):
            stretch_slope = -load_slopes[k, 0, column] / stiffness
            slope[3 * k + 2, column] = stretch_slope
            for axis in range(2):
                slope[3 * k + axis, column] = (
                    load_slopes[k, 1 + axis, column] * soft[k, 2] + load[1 + axis] * stretch_slope
                ) / rigidity
    return soft, slope
