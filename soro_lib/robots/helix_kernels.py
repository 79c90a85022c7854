"""Compiled scalar kinematics of a three-segment arm, for loops that evaluate one state at a time.

The same equations as :class:`soro_lib.robots.HelixArm` (tested equal), written for numba: one call takes
about a microsecond, which is what the state optimisation, the inner control loop and the elastic plant need.
Frame `arm_base`, z down; lengths in m, angles in rad. ``kernel.py_func`` is the plain Python form.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]

SEGMENTS = 3


@njit(cache=True)
def arc_coefficients(angle: float) -> tuple[float, float, float, float, float]:
    """Return sin(D)/D, (1-cos D)/D^2, (D-sin D)/D^3 and the slopes of the first two, each over D."""
    square = angle * angle
    if angle < 0.1:
        sine = 1.0 - square / 6 * (1 - square / 20 * (1 - square / 42 * (1 - square / 72)))
        cosine = 0.5 - square / 24 * (1 - square / 30 * (1 - square / 56 * (1 - square / 90)))
        cubic = 1 / 6 - square / 120 * (1 - square / 42 * (1 - square / 72))
        sine_slope = -1 / 3 + square / 30 * (1 - square / 28 * (1 - square / 54))
        cosine_slope = -1 / 12 + square / 180 * (1 - square * 3 / 112 * (1 - square * 2 / 135))
    else:
        half = np.sin(angle / 2) / angle
        sine = np.sin(angle) / angle
        cosine = 2 * half * half
        cubic = (1 - sine) / square
        sine_slope = (np.cos(angle) - sine) / square
        cosine_slope = (sine - 2 * cosine) / square
    return sine, cosine, cubic, sine_slope, cosine_slope


@njit(cache=True)
def arc(dx: float, dy: float, length: float, rotation: Array, translation: Array) -> None:
    """Write the rotation (3, 3) and translation (3,) of one arc (Vervloet, Eqs. (4)-(5), errata SH-2,
    SH-3)."""
    sine, cosine, _, _, _ = arc_coefficients(np.sqrt(dx * dx + dy * dy))
    rotation[0, 0] = 1 - cosine * dx * dx
    rotation[0, 1] = rotation[1, 0] = -cosine * dx * dy
    rotation[1, 1] = 1 - cosine * dy * dy
    rotation[0, 2] = sine * dx
    rotation[1, 2] = sine * dy
    rotation[2, 0] = -sine * dx
    rotation[2, 1] = -sine * dy
    rotation[2, 2] = 1 - cosine * (dx * dx + dy * dy)
    translation[0] = length * cosine * dx
    translation[1] = length * cosine * dy
    translation[2] = length * sine


@njit(cache=True)
def arc_derivatives(dx: float, dy: float, length: float, velocity: Array, spin: Array) -> None:
    """Write the columns d(translation)/d(dx, dy, length) and the angular velocities, both (3, 3), in the
    arc's base."""
    sine, cosine, cubic, sine_slope, cosine_slope = arc_coefficients(np.sqrt(dx * dx + dy * dy))
    velocity[0, 0] = length * (cosine + cosine_slope * dx * dx)
    velocity[0, 1] = velocity[1, 0] = length * cosine_slope * dx * dy
    velocity[1, 1] = length * (cosine + cosine_slope * dy * dy)
    velocity[2, 0] = length * sine_slope * dx
    velocity[2, 1] = length * sine_slope * dy
    velocity[0, 2] = cosine * dx
    velocity[1, 2] = cosine * dy
    velocity[2, 2] = sine
    spin[0, 0] = -cubic * dx * dy
    spin[1, 0] = 1 - cubic * dy * dy
    spin[2, 0] = -cosine * dy
    spin[0, 1] = -1 + cubic * dx * dx
    spin[1, 1] = cubic * dx * dy
    spin[2, 1] = cosine * dx
    spin[:, 2] = 0.0


@njit(cache=True)
def tip_points_and_jacobian(q: Array, gripper_length: float) -> tuple[Array, Array]:
    """Return wrist and gripper (6,) and their Jacobian (6, 9) at the state q (9,), in `arm_base`.

    Vervloet, Eqs. (4)-(7) and (12). An arc's angular velocity turns everything beyond its end about that end.
    """
    frames = np.empty((SEGMENTS + 1, 3, 3))
    origins = np.empty((SEGMENTS + 1, 3))
    frames[0] = np.eye(3)
    origins[0] = 0.0
    rotation = np.empty((3, 3))
    translation = np.empty(3)
    for i in range(SEGMENTS):
        arc(q[3 * i], q[3 * i + 1], q[3 * i + 2], rotation, translation)
        for row in range(3):
            origins[i + 1, row] = origins[i, row]
            for k in range(3):
                origins[i + 1, row] += frames[i, row, k] * translation[k]
                frames[i + 1, row, k] = 0.0
                for j in range(3):
                    frames[i + 1, row, k] += frames[i, row, j] * rotation[j, k]
    points = np.empty(6)
    for row in range(3):
        points[row] = origins[SEGMENTS, row]
        points[3 + row] = points[row] + gripper_length * frames[SEGMENTS, row, 2]

    jacobian = np.empty((6, 3 * SEGMENTS))
    velocity = np.zeros((3, 3))
    spin = np.zeros((3, 3))
    for i in range(SEGMENTS):
        arc_derivatives(q[3 * i], q[3 * i + 1], q[3 * i + 2], velocity, spin)
        for column in range(3):
            vx, vy, vz = rotate(frames[i], velocity[0, column], velocity[1, column], velocity[2, column])
            wx, wy, wz = rotate(frames[i], spin[0, column], spin[1, column], spin[2, column])
            for half in (0, 3):
                rx = points[half] - origins[i + 1, 0]
                ry = points[half + 1] - origins[i + 1, 1]
                rz = points[half + 2] - origins[i + 1, 2]
                jacobian[half, 3 * i + column] = vx + wy * rz - wz * ry
                jacobian[half + 1, 3 * i + column] = vy + wz * rx - wx * rz
                jacobian[half + 2, 3 * i + column] = vz + wx * ry - wy * rx
    return points, jacobian


@njit(cache=True)
def tip_points(q: Array, gripper_length: float) -> Array:
    """Return wrist and gripper (6,) at the state q (9,), in `arm_base` [m]."""
    points, _ = tip_points_and_jacobian(q, gripper_length)
    return points


@njit(cache=True)
def rotate(frame: Array, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Return frame @ (x, y, z) as three numbers."""
    return (
        frame[0, 0] * x + frame[0, 1] * y + frame[0, 2] * z,
        frame[1, 0] * x + frame[1, 1] * y + frame[1, 2] * z,
        frame[2, 0] * x + frame[2, 1] * y + frame[2, 2] * z,
    )


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
    frame = np.eye(3)
    frames = np.empty((SEGMENTS, 3, 3))
    rotation = np.empty((3, 3))
    translation = np.empty(3)
    velocity = np.zeros((3, 3))
    spin = np.zeros((3, 3))
    # First moment of all masses beyond the end of each segment, as (mass, mass * position) in the base frame.
    beyond_mass = np.zeros(SEGMENTS)
    beyond_moment = np.zeros((SEGMENTS, 3))
    origin = np.zeros(3)
    ends = np.empty((SEGMENTS, 3))
    for i in range(SEGMENTS):
        frames[i] = frame
        lump = segment_masses[i] / masses_per_segment
        for j in range(masses_per_segment):
            share = (j + 0.5) / masses_per_segment
            arc(share * q[3 * i], share * q[3 * i + 1], share * q[3 * i + 2], rotation, translation)
            position = origin + frame @ translation
            total += lump * position[2]
            for k in range(i):
                beyond_mass[k] += lump
                beyond_moment[k] += lump * position
            arc_derivatives(share * q[3 * i], share * q[3 * i + 1], share * q[3 * i + 2], velocity, spin)
            for column in range(3):
                gradient[3 * i + column] += lump * share * (frame[2] * velocity[:, column]).sum()
        arc(q[3 * i], q[3 * i + 1], q[3 * i + 2], rotation, translation)
        origin = origin + frame @ translation
        frame = frame @ rotation
        ends[i] = origin
    tip = origin + tip_distance * frame[:, 2]
    total += tip_mass * tip[2]
    for k in range(SEGMENTS):
        beyond_mass[k] += tip_mass
        beyond_moment[k] += tip_mass * tip
    for i in range(SEGMENTS):
        arc_derivatives(q[3 * i], q[3 * i + 1], q[3 * i + 2], velocity, spin)
        lever = beyond_moment[i] - beyond_mass[i] * ends[i]
        for column in range(3):
            _, _, fall = rotate(frames[i], velocity[0, column], velocity[1, column], velocity[2, column])
            wx, wy, _ = rotate(frames[i], spin[0, column], spin[1, column], spin[2, column])
            gradient[3 * i + column] += beyond_mass[i] * fall + wx * lever[1] - wy * lever[0]
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
