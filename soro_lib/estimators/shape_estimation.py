"""Where the arm really is: the state closest to the commanded one that explains the measured gripper pose.

Vervloet, Eq. (16), the state optimisation function (SOF): gravity pulls the arm away from the state its
tendons were cut to, so the controller works on the state `q_est` that minimises ``|A (q_est - q_sys)|``
subject to ``|f(q_est) - X_meas| <= bound``. The thesis prints the constraint with the square of the norm;
its text, its unit (m) and its Fig. 10 say norm (Erratum SH-6).
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from soro_lib.checks import positive
from soro_lib.poses import magnitude
from soro_lib.robots.helix_kernels import (
    cholesky,
    cholesky_solve,
    dot,
    kernel_vector,
    largest,
    multiply,
    outer_gram,
    tip_points_and_jacobian,
    unreachable_direction,
)

Array = NDArray[np.float64]

GRIPPER_LENGTH = 0.10
"""Distance from wrist to gripper [m] (Vervloet, Appendix A)."""

POSE_WEIGHTS = (1.0, 1.0, 1.0, 1.05, 1.05, 1.05, 1.1, 1.1, 1.1)
"""Diagonal of ``A_pose,upd``, for angles in rad and lengths in m (Vervloet, Appendix A)."""

MAXIMUM_ITERATIONS = 60
FULL_STEP_ITERATIONS = 25
LARGEST_STEP = 0.6
STEP_TOLERANCE = 1e-9


@dataclass(frozen=True)
class ShapeEstimate:
    """Result of the state optimisation.

    Attributes
    ----------
    q : ndarray, shape (9,)
        Estimated state (dx [rad], dy [rad], length [m] per segment).
    cost : float
        ``|A (q - q_sys)|``, the distance from the commanded state.
    residual : float
        ``|f(q) - X_meas|`` [m], at most the bound when converged.
    iterations : int
        Linearisations solved.
    converged : bool
        Whether `q` satisfies the constraint and the iteration came to rest.
    reason : str
        "", or why there is no optimum to hand back.
    """

    q: Array
    cost: float
    residual: float
    iterations: int
    converged: bool
    reason: str


def estimate_shape(
    q_sys: ArrayLike,
    measured_points: ArrayLike,
    bound: float = 0.005,
    weights: ArrayLike = POSE_WEIGHTS,
    gripper_length: float = GRIPPER_LENGTH,
) -> ShapeEstimate:
    """Return the state closest to the commanded one whose gripper pose lies within a bound of the measured
    one.

    Sequential linearisation; each linearised problem is a least-distance problem with one ball constraint
    and is solved exactly by its secular equation (Vervloet, Eq. (16), Erratum SH-6).

    Parameters
    ----------
    q_sys : array_like, shape (9,)
        Commanded state (dx [rad], dy [rad], length [m] per segment).
    measured_points : array_like, shape (6,)
        Measured wrist, then gripper [m], frame `arm_base`.
    bound : float
        Largest distance between estimated and measured points, both points together [m].
    weights : array_like, shape (9,)
        Diagonal of ``A_pose,upd``.
    gripper_length : float
        Distance from wrist to gripper [m].

    Returns
    -------
    ShapeEstimate
        `converged` is False, with the nearest state found, if no state explains the measurement.

    Raises
    ------
    ValueError
        If an argument has the wrong shape, is not finite, or is not positive where it must be.

    Examples
    --------
    >>> import numpy as np
    >>> straight = np.array([0, 0, 0.12, 0, 0, 0.24, 0, 0, 0.24])
    >>> estimate = estimate_shape(straight, [0.05, 0, 0.58, 0.06, 0, 0.68])
    >>> estimate.converged, round(estimate.residual, 6)
    (True, 0.005)
    """
    commanded, points, scale = checked_arguments(q_sys, measured_points, bound, weights)
    q, iterations, at_rest = sequential_least_distance(commanded, points, bound, scale, gripper_length)
    residual = magnitude(tip_points_and_jacobian(q, gripper_length)[0] - points)
    explained = residual <= bound * (1 + 1e-6) + 1e-9
    reason = ""
    if not explained:
        reason = (
            f"no state explains the measurement: {residual * 1e3:.1f} mm remain, {bound * 1e3:.1f} mm allowed"
        )
    elif not at_rest:
        reason = f"still moving after {iterations} linearisations"
    cost = float(np.linalg.norm(scale * (q - commanded)))
    return ShapeEstimate(q, cost, residual, iterations, explained and at_rest, reason)


def checked_arguments(
    q_sys: ArrayLike, measured_points: ArrayLike, bound: float, weights: ArrayLike
) -> tuple[Array, Array, Array]:
    """Return the three arrays as contiguous floats, or raise ValueError naming the one that is wrong."""
    positive("bound", bound)
    commanded, points = kernel_vector("q_sys", q_sys, 9), kernel_vector("measured_points", measured_points, 6)
    return commanded, points, kernel_vector("weights", weights, 9, above=0)


@njit(cache=True)
def sequential_least_distance(
    q_sys: Array, measured_points: Array, bound: float, weights: Array, gripper_length: float
) -> tuple[Array, int, bool]:
    """Return (q, iterations, whether the iteration came to rest) of Eq. (16)."""
    q = q_sys.copy()
    multiplier = 0.0
    for iteration in range(1, MAXIMUM_ITERATIONS + 1):
        points, jacobian = tip_points_and_jacobian(q, gripper_length)
        away = np.empty(9)
        for j in range(9):
            away[j] = q[j] - q_sys[j]
        covered = multiply(jacobian, away)
        residual = np.empty(6)
        for i in range(6):
            residual[i] = points[i] - measured_points[i] - covered[i]
            for j in range(9):
                jacobian[i, j] /= weights[j]
        stretch = unreachable_direction(points)
        move, multiplier = least_distance(jacobian, residual, stretch, bound, multiplier)
        step = np.empty(9)
        for j in range(9):
            step[j] = q_sys[j] + move[j] / weights[j] - q[j]
        longest = largest(step)
        if longest < STEP_TOLERANCE:
            return q, iteration, True
        factor = min(1.0, LARGEST_STEP / longest)
        if iteration > FULL_STEP_ITERATIONS:
            factor *= 0.5
        for j in range(9):
            q[j] += factor * step[j]
    return q, MAXIMUM_ITERATIONS, False


@njit(cache=True)
def least_distance(
    matrix: Array, residual: Array, stretch: Array, bound: float, multiplier: float
) -> tuple[Array, float]:
    """Return the shortest p with ``|matrix p + residual| <= bound`` and its Lagrange multiplier.

    The answer leaves ``rho = (I + t B)^-1 residual`` with ``B = matrix matrix'`` and is ``p = -t matrix'
    rho``. The multiplier t solves the secular equation ``1 / |rho(t)| = 1 / bound``, increasing and concave
    in t, so that Newton's method climbs to it from any guess. The part of the residual along `stretch`,
    which no p can change (Erratum SH-9), is paid from the bound, or left out where it alone exceeds the
    bound.
    """
    fixed = dot(stretch, residual)
    reachable = np.empty(6)
    for i in range(6):
        reachable[i] = residual[i] - fixed * stretch[i]
    allowed = bound if abs(fixed) >= bound else np.sqrt(bound * bound - fixed * fixed)
    if dot(reachable, reachable) <= allowed * allowed:
        return np.zeros(9), 0.0
    gram = outer_gram(matrix)
    remainder = reachable
    for _ in range(50):
        system = np.empty((6, 6))
        for i in range(6):
            for j in range(6):
                system[i, j] = multiplier * gram[i, j]
            system[i, i] += 1.0
        factor = cholesky(system)
        remainder = cholesky_solve(factor, reachable)
        length = np.sqrt(dot(remainder, remainder))
        if abs(length - allowed) <= 1e-12 * allowed:
            break
        slope = dot(remainder, cholesky_solve(factor, multiply(gram, remainder))) / length**3
        multiplier = max(0.0, multiplier + (1 / allowed - 1 / length) / slope)
    move = multiply(matrix.T, remainder)
    for j in range(9):
        move[j] *= -multiplier
    return move, multiplier


def estimate_shape_by_slsqp(
    q_sys: ArrayLike,
    measured_points: ArrayLike,
    bound: float = 0.005,
    weights: ArrayLike = POSE_WEIGHTS,
    gripper_length: float = GRIPPER_LENGTH,
) -> ShapeEstimate:
    """Solve the same problem as :func:`estimate_shape` as the equation reads, with SciPy's general solver.

    The readable reference: objective and constraint of Vervloet, Eq. (16), with analytic gradients.
    """
    from scipy.optimize import minimize

    commanded, points, scale = checked_arguments(q_sys, measured_points, bound, weights)

    def slack(q: Array) -> float:
        miss = tip_points_and_jacobian(q, gripper_length)[0] - points
        return float(bound**2 - miss @ miss)

    def slack_gradient(q: Array) -> Array:
        tip, jacobian = tip_points_and_jacobian(q, gripper_length)
        return -2 * jacobian.T @ (tip - points)

    def cost(q: Array) -> float:
        return float(np.sum((scale * (q - commanded)) ** 2))

    def cost_gradient(q: Array) -> Array:
        return 2 * scale**2 * (q - commanded)

    result = minimize(
        cost,
        commanded,
        jac=cost_gradient,
        constraints={"type": "ineq", "fun": slack, "jac": slack_gradient},
        method="SLSQP",
        options={"ftol": 1e-12, "maxiter": 200},
    )
    residual = float(np.linalg.norm(tip_points_and_jacobian(result.x, gripper_length)[0] - points))
    return ShapeEstimate(
        result.x, float(np.sqrt(result.fun)), residual, int(result.nit), bool(result.success), result.message
    )
