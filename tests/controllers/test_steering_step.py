"""One step of the inverse kinematics: the fast path against the readable one, limits, and the errata."""

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from soro_lib.controllers.obstacles import Sphere, clearances, smallest_clearance
from soro_lib.controllers.steering_step import (
    ReadableStep,
    StepBounds,
    StepWeights,
    avoiding_step,
    locked_step,
    pose_step,
    resolved_rate,
    solve,
    step_bound_as_printed,
)
from soro_lib.robots import CableDrivenArm
from soro_lib.robots.cable_driven_kernels import compiled_kinematics

ARM = CableDrivenArm()
KINEMATICS = compiled_kinematics(ARM)


def random_case(seed):
    """Return pose, wanted changes and bounds of a random, often tightly bounded step."""
    rng = np.random.default_rng(seed)
    actuation = rng.uniform(ARM.lower, ARM.upper)
    reach = np.array([4e-3, *[rng.choice([0.05, 0.5])] * 6])
    lower, upper = np.maximum(ARM.lower - actuation, -reach), np.minimum(ARM.upper - actuation, reach)
    wanted = rng.normal(0, 5e-3, 3), rng.normal(0, 0.1, 3), rng.normal(0, 2e-3, 3)
    return KINEMATICS(actuation), *wanted, StepBounds(lower, upper)


@pytest.mark.parametrize("locked", [False, True])
def test_fast_and_readable_steps_agree(locked):
    weights = StepWeights(locked_direction=3.0)
    readable = ReadableStep(weights, locked)
    assert readable.problem.is_dcp(dpp=True)
    for seed in range(25):
        pose, position, direction, mid, bounds = random_case(seed)
        if locked:
            fast = solve(locked_step(pose, position, mid, direction, bounds, weights))
        else:
            fast = solve(pose_step(pose, position, direction, bounds, weights))
        slow = readable.solve(
            pose, position, direction, mid, bounds, tol_gap_abs=1e-12, tol_gap_rel=1e-12, tol_feas=1e-12
        )
        assert fast.converged
        assert slow.converged
        np.testing.assert_allclose(fast.actuation_step, slow.actuation_step, atol=1e-6)
        assert (fast.actuation_step >= bounds.lower - 1e-9).all()
        assert (fast.actuation_step <= bounds.upper + 1e-9).all()


def test_step_is_the_minimum():
    weights = StepWeights()
    for seed in range(5):
        pose, position, direction, _, bounds = random_case(seed)
        problem = pose_step(pose, position, direction, bounds, weights)

        def cost(step, problem=problem):
            return step @ problem.hessian @ step / 2 + problem.gradient @ step

        found = solve(problem).actuation_step / [1e-3, *[1.0] * 6]
        brute = minimize(cost, np.zeros(7), bounds=list(zip(problem.lower, problem.upper)), tol=1e-14)
        assert cost(found) <= brute.fun + 1e-9


def test_damping_is_in_the_papers_units():
    """lambda = 1 beside millimetres: a step in metres must give the same cables as one in millimetres."""
    pose, position, direction, _, _ = random_case(3)
    free = np.full(7, 1e3)
    weights = StepWeights(damping=1.0, direction=0.0)
    ours = solve(pose_step(pose, position, direction, StepBounds(-free, free), weights)).actuation_step
    jacobian = pose.tip_jacobian * 1e3
    jacobian[:, 0] /= 1e3
    damping = np.diag([weights.slide_damping**2, *[1.0] * 6])
    expected = np.linalg.solve(jacobian.T @ jacobian + damping, jacobian.T @ position * 1e3)
    np.testing.assert_allclose(ours, expected * [1e-3, *[1.0] * 6], atol=1e-9)


def test_null_space_motion_leaves_the_tip_alone():
    """Lai et al., Eq. (25)."""
    jacobian = KINEMATICS(np.array([0.02, -0.5, -1, -0.3, -0.2, -0.7, -0.4])).tip_jacobian
    velocity, wish = np.array([0.01, -0.02, 0.03]), np.linspace(-1, 1, 7)
    np.testing.assert_allclose(jacobian @ resolved_rate(jacobian, velocity, wish), velocity, atol=1e-12)
    null = resolved_rate(jacobian, np.zeros(3), wish)
    np.testing.assert_allclose(jacobian @ null, 0.0, atol=1e-12)
    assert np.linalg.norm(null) > 0.1


def test_euler_angles_overconstrain_a_pointing_direction():
    """Erratum GS-16: the arm cannot choose its twist; a reachable direction is no reachable rotation."""
    rng = np.random.default_rng(0)
    twists = []
    for _ in range(200):
        pose = ARM.forward(rng.uniform(ARM.lower, ARM.upper))
        rotation, direction = Rotation.from_matrix(pose[:3, :3]), pose[:3, 2]
        axis = np.cross([0, 0, 1], direction)
        sine = np.linalg.norm(axis)
        twist_free = Rotation.from_rotvec(axis / max(sine, 1e-12) * np.arctan2(sine, direction[2]))
        twists.append(np.degrees((twist_free.inv() * rotation).magnitude()))
    assert np.median(twists) > 2.0
    assert np.max(twists) > 15.0


def test_printed_step_bound_ratchets():
    """Erratum GS-17: bounded from above only, cables release slowly, and the tip lags by millimetres."""
    matrix, bound = step_bound_as_printed()
    assert matrix.shape == (7, 7)
    time = np.arange(0, 8, 0.03)
    phase = 2 * np.pi * time / 8
    path = np.column_stack(
        [0.03 * np.sin(phase), 0.03 * np.sin(phase) * np.cos(phase), np.full_like(phase, 0.12)]
    )

    def errors(printed):
        actuation = np.array([0.03, *[-0.3] * 6])
        for _ in range(100):
            actuation = stepped(actuation, path[0], False)
        found = []
        for target in path:
            actuation = stepped(actuation, target, printed)
            found.append(np.linalg.norm(KINEMATICS(actuation).tip - target))
        return np.array(found)

    def stepped(actuation, target, printed):
        pose = KINEMATICS(actuation)
        wanted = target - pose.tip, np.array([0.0, 0.0, 1.0]) - pose.direction
        problem = pose_step(
            pose, *wanted, StepBounds(ARM.lower - actuation, ARM.upper - actuation), StepWeights()
        )
        if printed:
            problem = problem._replace(matrix=matrix, bound=bound)
        return np.clip(actuation + solve(problem).actuation_step, ARM.lower, ARM.upper)

    assert errors(False).max() < 0.2e-3
    assert errors(True).max() > 2e-3


def test_slide_damping_makes_the_step_unique():
    """Erratum GS-18: with lambda on the cables alone the Hessian is singular where no row sees the slide."""
    pose, _, direction, _, bounds = random_case(1)
    rows = pose.direction_jacobian  # the direction does not change with the slide
    printed = rows.T @ rows + np.diag([0.0, *[1.0] * 6])
    assert np.linalg.matrix_rank(printed) == 6
    assert np.linalg.matrix_rank(printed + np.diag([1e-4, *[0.0] * 6])) == 7
    assert solve(pose_step(pose, np.zeros(3), direction, bounds, StepWeights())).converged
    with pytest.raises(ValueError, match="slide_damping must be > 0"):
        StepWeights(slide_damping=0.0)


# --- obstacles ----------------------------------------------------------------------------------------------

BALL = Sphere((0.005, -0.003, 0.09), 0.01)


def test_avoidance_is_the_linearised_cost():
    """Lai et al., Eq. (29): for small steps the least squares has the gradient of the paper's cost."""
    actuation = np.array([0.02, -0.5, -1, -0.3, -0.2, -0.7, -0.4])
    pose, eta, wanted = KINEMATICS(actuation), 100.0, np.array([1e-3, -2e-3, 1e-3])
    near = clearances(ARM, actuation, [BALL])
    problem = avoiding_step(
        pose, wanted, near, StepBounds(-np.ones(7), np.ones(7)), StepWeights(avoidance=eta)
    )

    def cost(step):  # in mm, as printed
        after = np.clip(actuation + step * [1e-3, *[1.0] * 6], ARM.lower, ARM.upper)
        distance = smallest_clearance(ARM, after, BALL, 40) + near[0].contact
        position = (KINEMATICS(after).tip - pose.tip - wanted) * 1e3
        return position @ position + eta * (near[0].contact / distance) ** 2 + step[1:] @ step[1:]

    gradient = 2 * problem.gradient
    for column in range(7):
        nudge = np.zeros(7)
        nudge[column] = 1e-5
        slope = (cost(nudge) - cost(-nudge)) / 2e-5
        assert gradient[column] == pytest.approx(slope, rel=1e-3, abs=1e-2)


def test_contradicting_bounds_are_reported_not_solved():
    pose, position, direction, _, bounds = random_case(0)
    step = solve(
        pose_step(pose, position, direction, StepBounds(bounds.upper + 1, bounds.lower - 1), StepWeights())
    )
    assert not step.converged
    assert step.reason == "the bounds contradict each other"
    np.testing.assert_array_equal(step.actuation_step, 0.0)


def test_nan_is_reported_not_solved():
    pose, _, direction, _, bounds = random_case(0)
    step = solve(pose_step(pose, np.full(3, np.nan), direction, bounds, StepWeights()))
    assert not step.converged
    assert "not finite" in step.reason


@pytest.mark.parametrize("bad", [{"damping": -1.0}, {"direction": np.nan}, {"damping": 0.0}])
def test_bad_weights_are_named(bad):
    with pytest.raises(ValueError, match=next(iter(bad))):
        StepWeights(**bad)
