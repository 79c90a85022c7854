"""Compiled scalar kinematics of a three-segment arm, for loops that evaluate one state at a time.

The same arm as :class:`soro_lib.robots.HelixArm` (tested equal), on the compiled chain of
`soro_lib.arc_kernels`: one call takes a few microseconds, which is what the state optimisation, the inner
control loop and the elastic plant need. Frame `arm_base`, z down; lengths in m, angles in rad.

Sums and products of arrays are plain loops: numba takes several times longer to compile array expressions
and assignments to slices.
"""

from typing import Unpack

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from soro_lib.arc_kernels import (
    arc_numbers,
    arc_slopes,
    base_frame,
    carry,
    carry_frame,
    chain_frame_and_jacobian,
    end_velocities,
    frame_row,
    frame_velocities,
    swing,
)
from soro_lib.checks import Bounds, finite

Array = NDArray[np.float64]

SEGMENTS = 3


def kernel_vector(name: str, value: ArrayLike, size: int, **bounds: Unpack[Bounds]) -> Array:
    """Return finite numbers (size,) within bounds as every kernel takes them: contiguous, and a copy."""
    return np.array(finite(name, value, (size,), **bounds))


@njit(cache=True)
def tip_points_and_jacobian(q: Array, gripper_length: float) -> tuple[Array, Array]:
    """Return wrist and gripper (6,) and their Jacobian (6, 9) at the state q (9,), in `arm_base`.

    Vervloet, Eqs. (4)-(7) and (12).
    """
    frame, wrist_jacobian = chain_frame_and_jacobian(q.reshape(SEGMENTS, 3))
    gripper = (gripper_length * frame[0, 2], gripper_length * frame[1, 2], gripper_length * frame[2, 2])
    points = np.empty(6)
    jacobian = np.empty((6, 3 * SEGMENTS))
    for k in range(3):
        points[k] = frame[k, 3]
        points[3 + k] = frame[k, 3] + gripper[k]
        for column in range(3 * SEGMENTS):
            jacobian[k, column] = wrist_jacobian[k, column]
    for i in range(SEGMENTS):
        swing(wrist_jacobian, 3 * i, gripper)
    for k in range(3):
        for column in range(3 * SEGMENTS):
            jacobian[3 + k, column] = wrist_jacobian[k, column]
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
    frame = base_frame()
    velocities = np.empty((6, 3 * SEGMENTS))  # of each segment's end, by its own dx, dy and length
    ends = np.empty((SEGMENTS, 3))
    # All mass beyond the end of each segment, and its first moment in the base frame.
    beyond_mass = np.zeros(SEGMENTS)
    beyond_moment = np.zeros((SEGMENTS, 3))
    for i in range(SEGMENTS):
        dx, dy, length = q[3 * i], q[3 * i + 1], q[3 * i + 2]
        mass = segment_masses[i] / masses_per_segment
        for j in range(masses_per_segment):
            share = (j + 0.5) / masses_per_segment
            piece = arc_numbers(share * dx, share * dy, share * length)
            total += mass * carry(frame_row(frame, 2), piece)[3]
            sinking = end_velocities(frame_row(frame, 2), piece, arc_slopes(piece))
            gradient[3 * i] += mass * share * sinking[0]
            gradient[3 * i + 1] += mass * share * sinking[1]
            gradient[3 * i + 2] += mass * share * sinking[2]
            for before in range(i):
                beyond_mass[before] += mass
                for k in range(3):
                    beyond_moment[before, k] += mass * carry(frame_row(frame, k), piece)[3]
        arc = arc_numbers(dx, dy, length)
        frame_velocities(frame, arc, velocities, 3 * i)
        carry_frame(frame, arc)
        for k in range(3):
            ends[i, k] = frame[k, 3]
    total += tip_mass * (frame[2, 3] + tip_distance * frame[2, 2])
    for i in range(SEGMENTS):
        beyond_mass[i] += tip_mass
        for k in range(3):
            beyond_moment[i, k] += tip_mass * (frame[k, 3] + tip_distance * frame[k, 2])
            for column in range(3 * i, 3 * i + 3):
                velocities[k, column] *= beyond_mass[i]
        lever = (
            beyond_moment[i, 0] - beyond_mass[i] * ends[i, 0],
            beyond_moment[i, 1] - beyond_mass[i] * ends[i, 1],
            beyond_moment[i, 2] - beyond_mass[i] * ends[i, 2],
        )
        swing(velocities, 3 * i, lever)
    for column in range(3 * SEGMENTS):
        gradient[column] += velocities[2, column]
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
def dot(first: Array, second: Array) -> float:
    """Return the scalar product of two vectors, summed in order."""
    total = 0.0
    for i in range(first.shape[0]):
        total += first[i] * second[i]
    return total


@njit(cache=True)
def largest(vector: Array) -> float:
    """Return the largest magnitude of the entries of a vector, NaN if one of them is."""
    most = 0.0
    for i in range(vector.shape[0]):
        magnitude = abs(vector[i])
        if magnitude > most or np.isnan(magnitude):
            most = magnitude
    return most


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
    length = np.sqrt(dot(normal, normal))
    for k in range(6):
        normal[k] /= length
    return normal
