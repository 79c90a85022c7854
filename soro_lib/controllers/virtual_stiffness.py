"""Jacobian-based control with virtual stiffness and state limits: Vervloet, Eqs. (8)-(11), (17)-(22),
Algorithms 1-2.

Two states are kept apart: `q_sys`, which sets the tendons and must stay within the limits, and `q_est`,
which explains what the cameras see and is where the Jacobian is evaluated. What a limit takes from `q_sys`
is taken from `q_est` too; the limited coordinate becomes a hundred times stiffer, so that the next iteration
moves the others.

The kernels are plain Python compiled by numba; ``kernel.py_func`` runs the same lines uncompiled.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from soro_lib.checks import check_fields, finite, one_of
from soro_lib.poses import magnitude
from soro_lib.robots.helix import HelixArm
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

HELIX = HelixArm()
"""The arm of the thesis."""

VIRTUAL_STIFFNESS = (0.2, 0.2, 2.0, 0.1, 0.1, 1.0, 0.1, 0.1, 1.0)
"""Diagonal of ``K_initialize`` (Vervloet, Appendix A)."""

STIFFENING = 100.0
"""Factor by which a limited coordinate becomes stiffer (Vervloet, Algorithm 2, lines 11, 17 and 20)."""

STIFFEST = 1e-4
"""Smallest share of its first value that an inverse stiffness may fall to; the thesis sets no floor."""

LARGEST_STEP = 0.5
"""Largest change of one coordinate in one iteration [rad or m]; keeps goals out of reach from throwing the
state."""

DAMPING = 1e-12
"""Damping of the rank-5 inverse, as a share of the mean eigenvalue."""


def state_limits(arm: HelixArm) -> tuple[Array, Array]:
    """Return the lower and upper bounds (6,) of (d1, l1, d2, l2, d3, l3) (Vervloet, Eqs. (10)-(11))."""
    lower = np.stack([np.zeros(3), arm.minimum_lengths], axis=-1).ravel()
    upper = np.stack([arm.maximum_bends, arm.maximum_lengths], axis=-1).ravel()
    return lower, upper


def within_limits(q: ArrayLike, arm: HelixArm = HELIX, slack: float = 1e-9) -> bool:
    """Return whether a state satisfies Vervloet, Eq. (10), to a slack in rad and m."""
    lower, upper = state_limits(arm)
    bends_and_lengths = arm.bends_and_lengths(q)
    return bool((bends_and_lengths >= lower - slack).all() and (bends_and_lengths <= upper + slack).all())


def weighted_pseudo_inverse(jacobian: ArrayLike, inverse_stiffness: ArrayLike) -> Array:
    """Return ``K^-1 J' (J K^-1 J')^+`` (Vervloet, Eq. (19)); with unit stiffness the ``J^+`` of Eq. (17).

    The thesis prints an inverse, which does not exist: wrist and gripper keep their distance, so J has rank 5
    (Erratum SH-9). The pseudo-inverse drops that one direction.

    Parameters
    ----------
    jacobian : array_like, shape (6, 9)
        Jacobian of wrist and gripper.
    inverse_stiffness : array_like, shape (9,)
        Diagonal of ``K^-1``.

    Returns
    -------
    ndarray, shape (9, 6)
    """
    matrix = np.asarray(jacobian, dtype=float)
    compliant = np.asarray(inverse_stiffness, dtype=float)[:, None] * matrix.T
    return compliant @ np.linalg.pinv(matrix @ compliant, rcond=1e-8, hermitian=True)


def step_towards(measured_points: ArrayLike, goal_points: ArrayLike, step_size: float) -> Array:
    """Return ``X_goal,alpha = alpha X_goal + (1 - alpha) X_meas`` (Vervloet, Eq. (21))."""
    return step_size * np.asarray(goal_points) + (1 - step_size) * np.asarray(measured_points)


def jacobian_step(
    q: ArrayLike, jacobian: ArrayLike, error: ArrayLike, step_size: float, inverse_stiffness: ArrayLike
) -> Array:
    """Return ``q + alpha J_K^+ e``, one step without limits (Vervloet, Eqs. (17), (18), (20) and (22)).

    Unit stiffness gives Eqs. (17)-(18); ``step_size = 1`` with the error towards :func:`step_towards` gives
    Eq. (22).
    """
    return np.asarray(q) + step_size * weighted_pseudo_inverse(jacobian, inverse_stiffness) @ np.asarray(
        error
    )


@njit(cache=True)
def limit_state_in_place(q: Array, inverse_stiffness: Array, lower: Array, upper: Array) -> int:
    """Crop `q` (9,) to the limits and stiffen what was cropped, both in place; return the number of crops."""
    crops = 0
    for i in range(3):
        length = 3 * i + 2
        if q[length] < lower[2 * i + 1] or q[length] > upper[2 * i + 1]:
            q[length] = min(max(q[length], lower[2 * i + 1]), upper[2 * i + 1])
            inverse_stiffness[length] /= STIFFENING
            crops += 1
    for i in range(3):
        large, small = 3 * i, 3 * i + 1
        if abs(q[large]) <= abs(q[small]):
            large, small = small, large
        angle = np.sqrt(q[large] ** 2 + q[small] ** 2)
        bound = upper[2 * i]
        if angle > bound:
            if abs(q[small]) <= bound:
                q[large] = np.copysign(np.sqrt(bound**2 - q[small] ** 2), q[large])
            else:
                q[large] *= bound / angle
                q[small] *= bound / angle
            inverse_stiffness[large] /= STIFFENING
            crops += 1
    return crops


def limit_state(q: ArrayLike, inverse_stiffness: ArrayLike, arm: HelixArm = HELIX) -> tuple[Array, Array]:
    """Return the state within its limits and the inverse stiffness, smaller where a limit was met.

    Vervloet, Algorithm 2 (SKU), corrected: magnitudes are compared and signs kept (Erratum SH-12), the
    stiffness is returned (Erratum SH-11), and where the smaller component alone exceeds the bound, so that
    the printed root would be imaginary, both shrink together.

    Parameters
    ----------
    q : array_like, shape (9,)
        State (dx [rad], dy [rad], length [m] per segment).
    inverse_stiffness : array_like, shape (9,) or (9, 9)
        ``K^-1``, its diagonal or the diagonal matrix.
    arm : HelixArm
        Whose limits hold; the thesis's, Eq. (11), unless given.

    Returns
    -------
    q, inverse_stiffness : ndarray
        In the shapes given; the arguments are not changed.

    Raises
    ------
    ValueError
        If a shape is wrong or the state is not finite.

    Examples
    --------
    >>> q, softness = limit_state([1.0, 0, 0.15, 0, 0, 0.24, 0, 0, 0.24], [1.0] * 9)
    >>> q[:3].round(3).tolist(), softness[:3].tolist()
    ([0.785, 0.0, 0.14], [0.01, 1.0, 0.01])
    """
    state = finite("q", q, (9,)).copy()
    softness = np.array(inverse_stiffness, dtype=float)
    if softness.shape not in ((9,), (9, 9)):
        raise ValueError(f"inverse_stiffness must have shape (9,) or (9, 9), got {softness.shape}")
    diagonal = softness.diagonal().copy() if softness.ndim == 2 else softness
    limit_state_in_place(state, diagonal, *state_limits(arm))
    if softness.ndim == 2:
        np.fill_diagonal(softness, diagonal)
    return state, softness


@njit(cache=True)
def weighted_step(jacobian: Array, inverse_stiffness: Array, error: Array, stretch: Array) -> Array:
    """Return ``K^-1 J' (J K^-1 J')^+ e`` without a singular value decomposition.

    The one direction that J cannot reach is known (`stretch`): filling it makes the matrix invertible, and
    taking it out of the error makes the answer the pseudo-inverse's.
    """
    softened = np.empty((6, 9))
    for j in range(9):
        root = np.sqrt(inverse_stiffness[j])
        for i in range(6):
            softened[i, j] = jacobian[i, j] * root
    gram = outer_gram(softened)
    mean = 0.0
    for i in range(6):
        mean += gram[i, i]
    mean /= 6
    along = dot(stretch, error)
    reachable = np.empty(6)
    for i in range(6):
        reachable[i] = error[i] - along * stretch[i]
        for j in range(6):
            gram[i, j] += mean * stretch[i] * stretch[j]
        gram[i, i] += DAMPING * mean
    step = multiply(jacobian.T, cholesky_solve(cholesky(gram), reachable))
    for j in range(9):
        step[j] *= inverse_stiffness[j]
    return step


@njit(cache=True)
def reach_goal(
    q_sys: Array,
    q_est: Array,
    goal_step: Array,
    measured_points: Array,
    inverse_stiffness: Array,
    lower: Array,
    upper: Array,
    tolerance: float,
    max_iterations: int,
    early_exit: bool,
    from_measurement: bool,
    gripper_length: float,
) -> tuple[Array, Array, float, int, bool, int]:
    """Run Algorithm 1 from line 7 on; return (q_sys, q_est, residual, iterations, converged, crops)."""
    q_sys = q_sys.copy()
    q_est = q_est.copy()
    softness = inverse_stiffness.copy()
    new_sys = q_sys
    new_est = q_est
    points, jacobian = tip_points_and_jacobian(q_est, gripper_length)
    shift, error = np.zeros(6), np.empty(6)
    for k in range(6):
        error[k] = goal_step[k] - measured_points[k]
        if from_measurement:
            shift[k] = measured_points[k] - points[k]
    converged = False
    crops = 0
    iterations = 0
    residual = np.inf
    while iterations < max_iterations:
        iterations += 1
        step = weighted_step(jacobian, softness, error, unreachable_direction(points))
        share = min(1.0, LARGEST_STEP / max(largest(step), 1e-300))
        wanted = np.empty(9)
        for i in range(9):
            wanted[i] = q_sys[i] + share * step[i]
        q_sys = wanted.copy()
        crops += limit_state_in_place(q_sys, softness, lower, upper)
        moved = np.empty(9)
        for i in range(9):
            softness[i] = max(softness[i], STIFFEST * inverse_stiffness[i])
            moved[i] = q_est[i] + share * step[i] + (q_sys[i] - wanted[i])
        q_est = moved
        points, jacobian = tip_points_and_jacobian(q_est, gripper_length)
        for k in range(6):
            error[k] = goal_step[k] - (points[k] + shift[k])
        residual = np.sqrt(dot(error, error))
        if residual < tolerance:
            new_sys, new_est, converged = q_sys, q_est, True
            if early_exit:
                break
    if not converged:
        new_sys, new_est = q_sys, q_est
    return new_sys, new_est, residual, iterations, converged, crops


@dataclass(frozen=True)
class ControlStep:
    """Result of one run of Algorithm 1.

    Attributes
    ----------
    q_sys : ndarray, shape (9,)
        New commanded state, always within the limits.
    q_est : ndarray, shape (9,)
        State the arm is expected to take.
    residual : float
        Distance left to the step's goal according to the model [m], wrist and gripper together.
    iterations : int
        Iterations run.
    converged : bool
        Whether the residual fell below the tolerance.
    crops : int
        How often a limit was met.
    reason : str
        "", or why the goal of this step was not reached.
    """

    q_sys: Array
    q_est: Array
    residual: float
    iterations: int
    converged: bool
    crops: int
    reason: str


@dataclass(frozen=True)
class ErrorDependentStep:
    """A step size that grows with the distance to the goal (suggested by Vervloet, Section 5.4.4).

    Attributes
    ----------
    near, far : float
        Step size at and below `near_error`, at and above `far_error` [-].
    near_error, far_error : float
        Error of wrist and gripper together [m].
    """

    near: float = 0.4
    far: float = 1.0
    near_error: float = 0.05
    far_error: float = 0.20

    def __call__(self, error: float) -> float:
        """Return the step size at an error [m]."""
        return float(np.interp(error, [self.near_error, self.far_error], [self.near, self.far]))


@dataclass(frozen=True)
class VirtualStiffnessController:
    """Jacobian-based control with virtual stiffness within the state limits (Vervloet, Algorithm 1, JBC).

    Attributes
    ----------
    step_size : float or callable
        Share of the way to the goal to go in one step, in (0, 1], or a function of the error [m].
    stiffness : tuple of float
        Diagonal of the virtual stiffness ``K_initialize``; angles per rad, lengths per m.
    tolerance : float
        ``epsilon_control``: largest residual that counts as reached [m]. As a norm; the thesis prints its
        square (Erratum SH-6), which `tolerance=0.005**0.5` gives.
    max_iterations : int
        ``N_max,iter``.
    inner_loop : {"all", "early exit"}
        Run all iterations, as Algorithm 1 is printed, or leave at the first that is within the tolerance, as
        its text says (Erratum SH-10).
    error_reference : {"estimate", "measurement"}
        Inner error against the estimated pose, as printed, or against the measured pose plus the modelled
        movement, which removes the error floor ``epsilon_pose / alpha``.
    arm : HelixArm
        Its limits, Eq. (11), and its gripper length.

    Raises
    ------
    ValueError
        If a parameter is out of its bounds.
    """

    step_size: float | Callable[[float], float] = 0.1
    stiffness: tuple[float, ...] = VIRTUAL_STIFFNESS
    tolerance: float = 0.005
    max_iterations: int = 20
    inner_loop: Literal["all", "early exit"] = "all"
    error_reference: Literal["estimate", "measurement"] = "estimate"
    arm: HelixArm = HELIX

    def __post_init__(self) -> None:
        if not callable(self.step_size):
            check_fields(self, "step_size", above=0, at_most=1.5)
        check_fields(self, "stiffness", shape=(9,), above=0)
        check_fields(self, "tolerance", above=0)
        check_fields(self, "max_iterations", at_least=1)
        one_of("inner_loop", self.inner_loop, ("all", "early exit"))
        one_of("error_reference", self.error_reference, ("estimate", "measurement"))

    def update(
        self, q_sys: ArrayLike, q_est: ArrayLike, goal_points: ArrayLike, measured_points: ArrayLike
    ) -> ControlStep:
        """Return the commanded and the estimated state after one step (Vervloet, Algorithm 1, Eqs.
        (21)-(22)).

        Parameters
        ----------
        q_sys, q_est : array_like, shape (9,)
            Commanded and estimated state (dx [rad], dy [rad], length [m] per segment).
        goal_points, measured_points : array_like, shape (6,)
            Wrist, then gripper: where they should be and where they are seen [m], frame `arm_base`.

        Raises
        ------
        ValueError
            If an argument has the wrong shape or is not finite.
        """
        commanded, estimated = kernel_vector("q_sys", q_sys, 9), kernel_vector("q_est", q_est, 9)
        goal = kernel_vector("goal_points", goal_points, 6)
        measured = kernel_vector("measured_points", measured_points, 6)
        step_size = self.step_size
        if callable(step_size):
            step_size = step_size(magnitude(goal - measured))
        new_sys, new_est, residual, iterations, converged, crops = reach_goal(
            commanded,
            estimated,
            step_towards(measured, goal, step_size),
            measured,
            1 / np.asarray(self.stiffness),
            *state_limits(self.arm),
            self.tolerance,
            self.max_iterations,
            self.inner_loop == "early exit",
            self.error_reference == "measurement",
            self.arm.gripper_length,
        )
        reason = (
            "" if converged else f"{residual * 1e3:.1f} mm left of this step after {iterations} iterations"
        )
        return ControlStep(new_sys, new_est, float(residual), iterations, converged, crops, reason)
