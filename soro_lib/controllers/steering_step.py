"""One step of the constrained inverse kinematics: the least squares of Lai et al., Eqs. (26), (27) and (29).

Each objective is a sum of squares that is linear in the step of the actuation, so each step is a small convex
quadratic program. It is stated twice: as the paper writes it, in cvxpy (:class:`ReadableStep`), and as the
rows of one least-squares problem for the solver daqp (:func:`solve`). Both give the same step.

Units inside this module are the paper's, because its damping lambda = 1 depends on them: millimetres for the
slide and all positions, newtons for the cables. :class:`StepProblem` is built from SI quantities.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

import daqp
import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from soro_lib.checks import check_fields
from soro_lib.robots.cable_driven_kernels import Kinematics

if TYPE_CHECKING:
    import cvxpy

Array = NDArray[np.float64]

MILLIMETRE = 1e-3
CABLE_UNITS = np.array([MILLIMETRE] + [1.0] * 6)
"""SI value of one unit of each actuator of the cable-driven arm: a millimetre of slide, a newton of cable."""


@dataclass(frozen=True)
class StepWeights:
    """Weights of the least squares, in the paper's units.

    Parameters
    ----------
    damping : float
        lambda of Eqs. (26), (27), (29) on the cables [mm/N].
    slide_damping : float
        The same on the slide [-]. The paper has none, which leaves the Hessian singular where the slide and
        the cables can trade (erratum GS-18).
    direction : float
        How many millimetres of position one radian of direction is worth [mm/rad]. The paper adds mm^2 and
        rad^2 without a weight, i.e. 1 (erratum GS-16); half the robot's length is a sensible one.
    mid_point : float
        Weight of the locked mid point in Eq. (27) [-].
    locked_direction : float
        Weight of the direction in Eq. (27) [mm/rad]; the paper has no such term (erratum GS-19).
    avoidance : float
        eta of Eq. (29), with the obstacle term in mm [mm^2].
    """

    damping: float = 1.0
    slide_damping: float = 1e-2
    direction: float = 50.0
    mid_point: float = 1.0
    locked_direction: float = 0.0
    avoidance: float = 0.0

    def __post_init__(self) -> None:
        check_fields(self, at_least=0)
        if self.damping == 0 or self.slide_damping == 0:
            raise ValueError(
                "StepWeights.damping and slide_damping must be > 0: without them the step is not unique"
            )


class StepBounds(NamedTuple):
    """How far the actuation may go in one step.

    Attributes
    ----------
    lower, upper : ndarray (n,)
        Bounds of the step [m, then N].
    units : ndarray (n,)
        SI value of one unit of each actuator inside the solver; a millimetre takes the slide's damping,
        anything else lambda.
    """

    lower: Array
    upper: Array
    units: Array = CABLE_UNITS


class StepProblem(NamedTuple):
    """Minimise ``step' hessian step / 2 + gradient' step`` within bounds; in the units of the solver.

    Attributes
    ----------
    hessian : ndarray (n, n)
        Of the sum of squares, halved.
    gradient : ndarray (n,)
        At a step of zero, halved.
    lower, upper : ndarray (n,)
        Bounds of the step.
    finite : bool
        Whether every number above is one.
    units : ndarray (n,)
        SI value of one unit of each actuator.
    matrix, bound : ndarray (k, n), (k,)
        Inequalities ``matrix @ step <= bound``.
    """

    hessian: Array
    gradient: Array
    lower: Array
    upper: Array
    finite: bool
    units: Array
    matrix: Array
    bound: Array


class Step(NamedTuple):
    """Result of one step.

    Attributes
    ----------
    actuation_step : ndarray (n,)
        Change of the actuation [m, then N]; zero when not converged.
    converged : bool
        Whether the solver found the optimum.
    reason : str
        Why not, or "".
    """

    actuation_step: Array
    converged: bool
    reason: str = ""


def resolved_rate(jacobian: Array, velocity: ArrayLike, null_space_velocity: ArrayLike) -> Array:
    """Return the actuation velocity (n,) by pseudo-inverse and null-space projection; Lai et al., Eq. (25).

    Here for comparison: it knows no limits and no damping, which is why the paper turns to (26).

    Parameters
    ----------
    jacobian : ndarray (3, n)
        Tip Jacobian.
    velocity : array_like (3,)
        Wanted tip velocity [m/s].
    null_space_velocity : array_like (n,)
        Wanted actuation velocity, of which only the part that leaves the tip alone is used.
    """
    inverse = np.linalg.pinv(jacobian)
    wanted = np.asarray(null_space_velocity, dtype=float)
    return np.asarray(inverse @ np.asarray(velocity, dtype=float) + wanted - inverse @ (jacobian @ wanted))


# --- the three objectives ----------------------------------------------------------------------------------


def pose_step(
    kinematics: Kinematics,
    position_step: Array,
    direction_step: Array,
    bounds: StepBounds,
    weights: StepWeights,
) -> StepProblem:
    """Follow position and direction; Lai et al., Eq. (26).

    The paper's Euler angles over-constrain a pointing direction (erratum GS-16); here the direction itself
    is followed, a linear term of the same role.

    Parameters
    ----------
    kinematics : Kinematics
        Of the present actuation.
    position_step : ndarray (3,)
        Wanted change of the tip position [m].
    direction_step : ndarray (3,)
        Wanted change of the pointing direction [rad].
    bounds : StepBounds
        Of the step of the actuation.
    weights : StepWeights
        See there.
    """
    position = (kinematics.tip_jacobian, position_step, 1 / MILLIMETRE)
    direction = (kinematics.direction_jacobian, direction_step, weights.direction)
    return _problem(position, direction, bounds, weights)


def locked_step(
    kinematics: Kinematics,
    position_step: Array,
    mid_step: Array,
    direction_step: Array,
    bounds: StepBounds,
    weights: StepWeights,
) -> StepProblem:
    """Follow the position with the mid point held; Lai et al., Eq. (27).

    Parameters are those of :func:`pose_step`, and ``mid_step``: wanted change of the mid point (3,) [m].
    """
    position = (kinematics.tip_jacobian, position_step, 1 / MILLIMETRE)
    mid_position = (kinematics.mid_jacobian, mid_step, weights.mid_point / MILLIMETRE)
    problem = _problem(position, mid_position, bounds, weights)
    if weights.locked_direction > 0:
        direction = (kinematics.direction_jacobian, direction_step, weights.locked_direction)
        _add_squares(problem.hessian, problem.gradient, *direction, bounds.units)
    return problem


@dataclass(frozen=True, eq=False)
class Clearance:
    """Distance of one point of the arm to an obstacle, and how it changes.

    Attributes
    ----------
    distance : float
        From the axis of the arm to the centre of the obstacle [m].
    gradient : ndarray (n,)
        Its derivative by the actuation.
    contact : float
        Distance at which arm and obstacle touch: R_obs + R_sr [m].
    """

    distance: float
    gradient: Array
    contact: float


def avoiding_step(
    kinematics: Kinematics,
    position_step: Array,
    clearances: Sequence[Clearance],
    bounds: StepBounds,
    weights: StepWeights,
    margin: float | None = None,
) -> StepProblem:
    """Follow the position and keep away from obstacles; Lai et al., Eq. (29), linearised.

    Parameters
    ----------
    kinematics, position_step, bounds, weights
        As in :func:`pose_step`.
    clearances : sequence of Clearance
        The nearest point comes first; it alone enters the cost of (29).
    margin : float, optional
        If given, every clearance must stay above this [m]: a linear inequality, which (29) does not have.
    """
    position = (kinematics.tip_jacobian, position_step, 1 / MILLIMETRE)
    avoidance = (_no_rows(len(bounds.units)), _NOTHING, 0.0)
    if weights.avoidance > 0 and clearances:
        nearest = clearances[0]
        ratio = nearest.contact / nearest.distance
        slope = -ratio / nearest.distance * nearest.gradient
        avoidance = (slope[None], np.array([-ratio]), math.sqrt(weights.avoidance))
    problem = _problem(position, avoidance, bounds, weights)
    if margin is None or not clearances:
        return problem
    approach = np.array([-item.gradient for item in clearances]) * bounds.units / MILLIMETRE
    room = np.array([item.distance - item.contact - margin for item in clearances]) / MILLIMETRE
    return problem._replace(matrix=approach, bound=room)


def step_bound_as_printed(actuators: int = 7) -> tuple[Array, Array]:
    """Return A and b below Lai et al., Eq. (26), as ``A @ step <= b`` in mm and N.

    The print has six entries for seven variables (erratum GS-17); the missing one is taken to be a cable's.
    It bounds a step from above only, so it lets cables pull freely and release slowly.
    """
    return np.diag([1e-3] + [1.0] * (actuators - 1)), np.full(actuators, 1e-2)


Squares = tuple[Array, Array, float]
"""A sum of squares ``weight^2 |jacobian step - wanted|^2``: (jacobian, wanted, weight), SI."""


def _problem(first: Squares, second: Squares, bounds: StepBounds, weights: StepWeights) -> StepProblem:
    """Add two sums of squares and the damping, in the units of the solver."""
    lower, upper, units = bounds
    hessian, gradient, low, high, finite = _normal_equations(
        *first, *second, weights.damping, weights.slide_damping, units, lower, upper
    )
    return StepProblem(hessian, gradient, low, high, finite, units, _no_rows(len(units)), _NOTHING)


_NOTHING = np.zeros(0)


@cache
def _no_rows(actuators: int) -> Array:
    return np.zeros((0, actuators))


@cache
def _inequalities(rows: int) -> NDArray[np.intc]:
    return np.zeros(rows, dtype=np.intc)


@njit(cache=True)
def _add_squares(hessian, gradient, jacobian, wanted, weight, units):  # type: ignore[no-untyped-def]
    for row in range(len(wanted)):
        for i in range(len(units)):
            entry = weight * weight * jacobian[row, i] * units[i]
            gradient[i] -= entry * wanted[row]
            for j in range(len(units)):
                hessian[i, j] += entry * jacobian[row, j] * units[j]


@njit(cache=True)
def _normal_equations(  # type: ignore[no-untyped-def]
    first, wanted1, weight1, second, wanted2, weight2, damping, slide_damping, units, lower, upper
):
    """Return hessian, gradient, lower and upper bounds in the solver's units, and whether all are finite."""
    actuators = len(units)
    hessian, gradient = np.zeros((actuators, actuators)), np.zeros(actuators)
    _add_squares(hessian, gradient, first, wanted1, weight1, units)
    _add_squares(hessian, gradient, second, wanted2, weight2, units)
    low, high = np.empty(actuators), np.empty(actuators)
    total = 0.0
    for i in range(actuators):
        hessian[i, i] += (slide_damping if units[i] == MILLIMETRE else damping) ** 2
        low[i], high[i] = lower[i] / units[i], upper[i] / units[i]
        total += gradient[i] + low[i] + high[i]
        for j in range(actuators):
            total += hessian[i, j]
    return hessian, gradient, low, high, np.isfinite(total)


# --- solving -----------------------------------------------------------------------------------------------


def solve(problem: StepProblem) -> Step:
    """Solve one step with daqp.

    Returns
    -------
    Step
        With ``converged`` False and a zero step when the bounds contradict each other or the solver gives up.
    """
    hessian, gradient, lower, upper, finite, units, matrix, bound = problem
    if not finite:
        return Step(np.zeros(len(gradient)), False, "the problem is not finite")
    if len(bound):
        upper = np.concatenate([upper, bound])
        lower = np.concatenate([lower, np.full(len(bound), -1e30)])
    step, _, flag, _ = daqp.solve(hessian, gradient, matrix, upper, lower, _inequalities(len(upper)))
    if flag < 1:
        reason = "the bounds contradict each other" if flag == -1 else f"daqp stopped with flag {flag}"
        return Step(np.zeros(len(gradient)), False, reason)
    return Step(step * units, True)


class ReadableStep:
    """The same least squares as the paper writes them, in cvxpy with parameters (DPP): the reference for
    :func:`solve`.

    Parameters
    ----------
    weights : StepWeights
        See there.
    locked : bool
        Eq. (27) instead of Eq. (26).
    """

    def __init__(self, weights: StepWeights, locked: bool = False) -> None:
        import cvxpy as cp

        self.J, self.J_M, self.J_n = (cp.Parameter((3, 7)) for _ in range(3))
        self.dx, self.dx_M, self.dn = (cp.Parameter(3) for _ in range(3))
        self.lower, self.upper = cp.Parameter(7), cp.Parameter(7)
        self.dq = cp.Variable(7)

        position = cp.sum_squares(self.J @ self.dq - self.dx)
        direction = cp.sum_squares(self.J_n @ self.dq - self.dn)
        mid_position = cp.sum_squares(self.J_M @ self.dq - self.dx_M)
        least_motion = cp.sum_squares(self.dq[1:])

        regularisation = weights.slide_damping**2 * cp.square(self.dq[0])
        objective = position + weights.damping**2 * least_motion + regularisation
        if locked:
            objective += weights.mid_point**2 * mid_position + weights.locked_direction**2 * direction
        else:
            objective += weights.direction**2 * direction
        self.problem: cvxpy.Problem = cp.Problem(
            cp.Minimize(objective), [self.lower <= self.dq, self.dq <= self.upper]
        )

    def solve(
        self,
        kinematics: Kinematics,
        position_step: ArrayLike,
        direction_step: ArrayLike,
        mid_step: ArrayLike,
        bounds: StepBounds,
        **options: Any,
    ) -> Step:
        """Solve one step; arguments as in :func:`pose_step` and :func:`locked_step`, options go to cvxpy."""
        lower, upper, units = bounds
        self.J.value = kinematics.tip_jacobian * units / MILLIMETRE
        self.J_M.value = kinematics.mid_jacobian * units / MILLIMETRE
        self.J_n.value = kinematics.direction_jacobian * units
        self.dx.value, self.dx_M.value = np.divide(position_step, MILLIMETRE), np.divide(mid_step, MILLIMETRE)
        self.dn.value = np.asarray(direction_step, dtype=float)
        self.lower.value, self.upper.value = lower / units, upper / units
        self.problem.solve(**{"solver": "CLARABEL", **options})
        if self.problem.status != "optimal" or self.dq.value is None:
            return Step(np.zeros(7), False, f"cvxpy: {self.problem.status}")
        return Step(self.dq.value * units, True)
