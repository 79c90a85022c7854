"""Compiled kinematics of the cable-driven arm: positions, pointing direction and all Jacobians in one call.

The same model as :class:`soro_lib.robots.CableDrivenArm` (tested equal to it), for loops that run at the rate
of the sensor. Lai et al., Eqs. (1)-(3), (22)-(25).
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from soro_lib.robots.base import Robot
from soro_lib.robots.cable_driven import CABLE_ANGLES, CableDrivenArm

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
    parameters = np.array(
        [arm.segment_length, arm.cable_radius, arm.axial_stiffness, arm.bending_rigidity,
         float(arm.coupling_sign), arm.cap_length]
    )  # fmt: skip

    def kinematics(actuation: Array) -> Kinematics:
        return Kinematics(*_kinematics(actuation, parameters))

    return kinematics


def generic_kinematics(robot: Robot) -> Callable[[Array], Kinematics]:
    """Return the kinematics of any arm through the public robot interface.

    {M} is the middle of the chain of pieces. Slower than the compiled form, same result.
    """
    from soro_lib.arcs import chain_jacobian, chain_transform

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


_COS, _SIN = np.cos(CABLE_ANGLES), np.sin(CABLE_ANGLES)


@njit(cache=True)
def _arc(vx, vy):  # type: ignore[no-untyped-def]
    """Return S, A, c = cos(theta) and the slopes S1 = S'/theta, A1 = A'/theta of one arc."""
    t = vx * vx + vy * vy
    if t < 1e-2:
        sinc = 1 - t / 6 * (1 - t / 20 * (1 - t / 42 * (1 - t / 72)))
        versine = 0.5 - t / 24 * (1 - t / 30 * (1 - t / 56 * (1 - t / 90)))
        sinc_slope = -1 / 3 + t / 30 * (1 - t / 28 * (1 - t / 54))
        versine_slope = -1 / 12 + t / 180 * (1 - t * 3 / 112 * (1 - t * 2 / 135))
        return sinc, versine, 1 - t * versine, sinc_slope, versine_slope
    theta = np.sqrt(t)
    sinc, cosine = np.sin(theta) / theta, np.cos(theta)
    versine = (1 - cosine) / t
    return sinc, versine, cosine, (cosine - sinc) / t, (sinc - 2 * versine) / t


@njit(cache=True)
def _end(vx, vy, arc, out, slope):  # type: ignore[no-untyped-def]
    """Fill the end direction (3,) of an arc, the unit-length end point (3,) and their slopes by vx, vy."""
    sinc, versine, cosine, sinc_slope, versine_slope = arc
    v = (vx, vy)
    for i in range(2):
        out[0, i], out[1, i] = versine * v[i], sinc * v[i]
        for j in range(2):
            delta = 1.0 if i == j else 0.0
            slope[0, j, i] = versine * delta + versine_slope * v[j] * v[i]
            slope[1, j, i] = sinc * delta + sinc_slope * v[j] * v[i]
        slope[0, i, 2], slope[1, i, 2] = sinc_slope * v[i], -sinc * v[i]
    out[0, 2], out[1, 2] = sinc, cosine


@njit(cache=True)
def _turn(vx, vy, arc, p, out):  # type: ignore[no-untyped-def]
    """Apply the rotation of an arc, Lai et al., Eq. (24), to the vector p."""
    sinc, versine, cosine, _, _ = arc
    along = vx * p[0] + vy * p[1]
    out[0] = p[0] - versine * vx * along + sinc * vx * p[2]
    out[1] = p[1] - versine * vy * along + sinc * vy * p[2]
    out[2] = -sinc * along + cosine * p[2]


@njit(cache=True)
def _turn_slope(vx, vy, arc, j, p, out):  # type: ignore[no-untyped-def]
    """Apply the derivative of the rotation by vx (j = 0) or vy (j = 1) to the vector p."""
    sinc, versine, _, sinc_slope, versine_slope = arc
    vj, pj = (vx, p[0]) if j == 0 else (vy, p[1])
    along = vx * p[0] + vy * p[1]
    radial = -versine_slope * vj * along - versine * pj + sinc_slope * vj * p[2]
    out[0], out[1] = vx * radial, vy * radial
    out[j] += sinc * p[2] - versine * along
    out[2] = -sinc_slope * vj * along - sinc * pj - sinc * vj * p[2]


@njit(cache=True)
def _kinematics(q, parameters):  # type: ignore[no-untyped-def]
    length, radius, stiffness, rigidity, coupling, cap = parameters
    force, moment = np.zeros(2), np.zeros((2, 2))
    for k in range(2):
        for i in range(3):
            tension = -q[1 + 3 * k + i]
            force[k] += tension
            moment[k, 0] += radius * tension * _COS[i]
            moment[k, 1] += radius * tension * _SIN[i]
    s1, s2 = length - (force[0] + force[1]) / stiffness, length - force[1] / stiffness
    m1x, m1y = moment[0, 0] + coupling * moment[1, 0], moment[0, 1] + coupling * moment[1, 1]
    v1x, v1y = m1x * s1 / rigidity, m1y * s1 / rigidity
    v2x, v2y = moment[1, 0] * s2 / rigidity, moment[1, 1] * s2 / rigidity

    arc1, arc2 = _arc(v1x, v1y), _arc(v2x, v2y)
    end1, end2, slope1, slope2 = np.empty((2, 3)), np.empty((2, 3)), np.empty((2, 2, 3)), np.empty((2, 2, 3))
    _end(v1x, v1y, arc1, end1, slope1)
    _end(v2x, v2y, arc2, end2, slope2)
    reach2 = s2 * end2[0] + cap * end2[1]
    mid, tip, direction, w = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for a in range(3):
        mid[a] = s1 * end1[0, a] + cap * end1[1, a]
    mid[2] += q[0]
    _turn(v1x, v1y, arc1, reach2, w)
    for a in range(3):
        tip[a] = mid[a] + w[a]
    _turn(v1x, v1y, arc1, end2[1], direction)

    # derivatives by (v1x, v1y, s1, v2x, v2y, s2)
    d_mid, d_tip, d_direction = np.zeros((6, 3)), np.zeros((6, 3)), np.zeros((6, 3))
    for j in range(2):
        for a in range(3):
            d_mid[j, a] = s1 * slope1[0, j, a] + cap * slope1[1, j, a]
        _turn_slope(v1x, v1y, arc1, j, reach2, w)
        for a in range(3):
            d_tip[j, a] = d_mid[j, a] + w[a]
        _turn_slope(v1x, v1y, arc1, j, end2[1], d_direction[j])
        _turn(v1x, v1y, arc1, s2 * slope2[0, j] + cap * slope2[1, j], d_tip[3 + j])
        _turn(v1x, v1y, arc1, slope2[1, j], d_direction[3 + j])
    for a in range(3):
        d_mid[2, a] = d_tip[2, a] = end1[0, a]
    _turn(v1x, v1y, arc1, end2[0], d_tip[5])

    # actuation to arcs: tension = -command
    gain = np.zeros((6, 7))
    for k in range(2):
        for i in range(3):
            column = 1 + 3 * k + i
            sign = 1.0 if k == 0 else coupling
            gain[0, column] = -sign * radius * _COS[i] * s1 / rigidity + m1x / (stiffness * rigidity)
            gain[1, column] = -sign * radius * _SIN[i] * s1 / rigidity + m1y / (stiffness * rigidity)
            gain[2, column] = 1.0 / stiffness
            if k == 1:
                gain[3, column] = -radius * _COS[i] * s2 / rigidity + moment[1, 0] / (stiffness * rigidity)
                gain[4, column] = -radius * _SIN[i] * s2 / rigidity + moment[1, 1] / (stiffness * rigidity)
                gain[5, column] = 1.0 / stiffness
    tip_jacobian, mid_jacobian, direction_jacobian = np.zeros((3, 7)), np.zeros((3, 7)), np.zeros((3, 7))
    for a in range(3):
        for column in range(1, 7):
            for u in range(6):
                tip_jacobian[a, column] += d_tip[u, a] * gain[u, column]
                mid_jacobian[a, column] += d_mid[u, a] * gain[u, column]
                direction_jacobian[a, column] += d_direction[u, a] * gain[u, column]
    tip_jacobian[2, 0] = mid_jacobian[2, 0] = 1.0
    return tip, mid, direction, tip_jacobian, mid_jacobian, direction_jacobian
