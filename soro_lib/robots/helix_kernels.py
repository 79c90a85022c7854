"""Compiled scalar kinematics of a three-segment arm, for loops that evaluate one state at a time.

The same arm as :class:`soro_lib.robots.HelixArm` (tested equal), on the compiled chain of
`soro_lib.arc_kernels`: one call takes a few microseconds, which is what the state optimisation, the inner
control loop and the elastic plant need. Frame `arm_base`, z down; lengths in m, angles in rad.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from soro_lib.arc_kernels import arc_numbers, carry_frame, chain_frame_and_jacobian, frame_velocities, swing

Array = NDArray[np.float64]

SEGMENTS = 3


@njit(cache=True)
def tip_points_and_jacobian(q: Array, gripper_length: float) -> tuple[Array, Array]:
    """Return wrist and gripper (6,) and their Jacobian (6, 9) at the state q (9,), in `arm_base`.

    Vervloet, Eqs. (4)-(7) and (12).
    """
    frame, wrist_jacobian = chain_frame_and_jacobian(q.reshape(SEGMENTS, 3))
    gripper = gripper_length * frame[:, 2]
    points = np.concatenate((frame[:, 3], frame[:, 3] + gripper))
    jacobian = np.empty((6, 3 * SEGMENTS))
    jacobian[:3] = wrist_jacobian[:3]
    swing(wrist_jacobian, gripper)
    jacobian[3:] = wrist_jacobian[:3]
    return points, jacobian


@njit(cache=True)
def tip_points(q: Array, gripper_length: float) -> Array:
    """Return wrist and gripper (6,) at the state q (9,), in `arm_base` [m]."""
    points, _ = tip_points_and_jacobian(q, gripper_length)
    return points


@njit(cache=True)
def depth_moment(
    q: Array, segment_masses: Array, masses_per_segment: int, tip_mass: float, tip_distance: float
) -> tuple[float, Array]:
    """Return sum(m z) [kg m] of an arm with lumped masses and its gradient (9,): gravity's energy is -g
    times it.

    Every segment carries its mass in equal lumps along the arc, the gripper one lump ``tip_distance`` past
    the wrist.
    """
    total = 0.0
    gradient = np.zeros(3 * SEGMENTS)
    frame = np.zeros((3, 4))
    frame[0, 0] = frame[1, 1] = frame[2, 2] = 1.0
    ends = np.empty((SEGMENTS, 3))
    velocities = np.empty((SEGMENTS, 6, 3))
    # All mass beyond the end of each segment, and its first moment in the base frame.
    beyond_mass = np.zeros(SEGMENTS)
    beyond_moment = np.zeros((SEGMENTS, 3))
    for i in range(SEGMENTS):
        dx, dy, length = q[3 * i], q[3 * i + 1], q[3 * i + 2]
        mass = segment_masses[i] / masses_per_segment
        for j in range(masses_per_segment):
            share = (j + 0.5) / masses_per_segment
            piece = arc_numbers(share * dx, share * dy, share * length)
            position = carry_frame(frame, piece)[:, 3]
            total += mass * position[2]
            gradient[3 * i : 3 * i + 3] += mass * share * frame_velocities(frame, piece)[2]
            beyond_mass[:i] += mass
            beyond_moment[:i] += mass * position
        arc = arc_numbers(dx, dy, length)
        velocities[i] = frame_velocities(frame, arc)
        frame = carry_frame(frame, arc)
        ends[i] = frame[:, 3]
    tip = frame[:, 3] + tip_distance * frame[:, 2]
    total += tip_mass * tip[2]
    beyond_mass += tip_mass
    beyond_moment += tip_mass * tip
    for i in range(SEGMENTS):
        moment_change = velocities[i]
        moment_change[:3] *= beyond_mass[i]
        swing(moment_change, beyond_moment[i] - beyond_mass[i] * ends[i])
        gradient[3 * i : 3 * i + 3] += moment_change[2]
    return total, gradient


@njit(cache=True)
def cholesky(matrix: Array) -> Array:
    """Return the lower factor of a positive definite matrix; its [0, 0] is NaN if the matrix is not."""
    n = matrix.shape[0]
    factor = np.zeros((n, n))
    for i in range(n):
        for j in range(i + 1):
            rest = matrix[i, j]
            for k in range(j):
                rest -= factor[i, k] * factor[j, k]
            if i > j:
                factor[i, j] = rest / factor[j, j]
            elif rest > 0:
                factor[i, i] = np.sqrt(rest)
            else:
                factor[0, 0] = np.nan
                return factor
    return factor


@njit(cache=True)
def cholesky_solve(factor: Array, vector: Array) -> Array:
    """Return x with ``factor factor' x = vector``."""
    n = vector.shape[0]
    x = vector.copy()
    for i in range(n):
        for k in range(i):
            x[i] -= factor[i, k] * x[k]
        x[i] /= factor[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            x[i] -= factor[k, i] * x[k]
        x[i] /= factor[i, i]
    return x


@njit(cache=True)
def multiply(matrix: Array, vector: Array) -> Array:
    """Return matrix @ vector; plain loops beat BLAS at these sizes."""
    product = np.zeros(matrix.shape[0])
    for i in range(matrix.shape[0]):
        for j in range(matrix.shape[1]):
            product[i] += matrix[i, j] * vector[j]
    return product


@njit(cache=True)
def outer_gram(matrix: Array) -> Array:
    """Return matrix @ matrix.T."""
    n = matrix.shape[0]
    gram = np.zeros((n, n))
    for i in range(n):
        for j in range(i + 1):
            for k in range(matrix.shape[1]):
                gram[i, j] += matrix[i, k] * matrix[j, k]
            gram[j, i] = gram[i, j]
    return gram


@njit(cache=True)
def unreachable_direction(points: Array) -> Array:
    """Return the unit vector (6,) along which no state moves the tip: stretching the rigid gripper (Erratum
    SH-9)."""
    normal = np.empty(6)
    for k in range(3):
        normal[3 + k] = points[3 + k] - points[k]
        normal[k] = -normal[3 + k]
    return normal / np.sqrt((normal**2).sum())
