"""Gesture steering: one control step, its filter and quadratic program against others, a replayed minute.

The quadratic program is the same for all, which is checked before anything is timed. SLSQP solves the
nonlinear problem that the paper gives to its SQP, from the same start.
"""

from collections.abc import Callable
from typing import Any

import daqp
import numpy as np
from scipy.optimize import minimize

from benchmarks.run import Row, compare, seconds_per_call
from soro_lib.controllers.gesture_steering import GestureSteering, replay
from soro_lib.controllers.steering_step import ReadableStep, StepBounds, StepWeights, pose_step, solve
from soro_lib.estimators.palm_filter import PalmFilter, ReadablePalmFilter
from soro_lib.papers.gesture_steering.recordings import load_recording
from soro_lib.robots import CableDrivenArm
from soro_lib.robots.cable_driven_kernels import compiled_kinematics, generic_kinematics
from soro_lib.sensing.hand_tracking import hand_samples

ARM = CableDrivenArm()
KINEMATICS = compiled_kinematics(ARM)
ACTUATION = np.array([0.02, -0.5, -1.0, -0.3, -0.2, -0.7, -0.4])
POSITION_STEP, DIRECTION_STEP = np.array([1e-3, -2e-3, 1e-3]), np.array([0.02, 0.01, 0.0])
WEIGHTS = StepWeights()
REACH = np.array([4.5e-3, *[0.09] * 6])
BOUNDS = StepBounds(
    np.maximum(ARM.lower - ACTUATION, -REACH), np.minimum(ARM.upper - ACTUATION, REACH)
)  # one frame of 30 ms


def rows() -> list[Row]:
    """Return the comparisons of gesture steering."""
    pose = KINEMATICS(ACTUATION)
    readable = ReadableStep(WEIGHTS)

    def fast() -> Any:
        return solve(pose_step(pose, POSITION_STEP, DIRECTION_STEP, BOUNDS, WEIGHTS))

    def parametrised() -> Any:
        return readable.solve(pose, POSITION_STEP, DIRECTION_STEP, np.zeros(3), BOUNDS)

    np.testing.assert_allclose(fast().actuation_step, parametrised().actuation_step, atol=1e-5)
    return [
        *control_step(),
        *palm_filter(),
        *compare("one step, Eq. (26), assembled and solved", fast,
                 {"raw daqp, already assembled (goal: at most 3 times)": raw_daqp(pose),
                  "parametrised cvxpy (goal: 30 times)": parametrised}),
        *compare("kinematics and QP of one step", lambda: (KINEMATICS(ACTUATION), fast()),
                 {"SciPy SLSQP, gradients by differences (goal: 100 times)": by_differences,
                  "SciPy SLSQP, analytic gradients": by_gradients}),
        *compare("kinematics with all Jacobians", lambda: KINEMATICS(ACTUATION),
                 {"robot interface": lambda: generic_kinematics(ARM)(ACTUATION)}, goal=10.0),
    ]  # fmt: skip


def control_step() -> list[Row]:
    """Time whole control steps on the shipped recording: filter, interpolation, kinematics, program."""
    samples = list(hand_samples(load_recording("steering_minute")))
    steering, with_filterpy = GestureSteering(ARM), GestureSteering(ARM)

    def minute() -> None:
        replay(GestureSteering(ARM), samples)

    def thousand() -> None:
        steering.reset(ARM.home)
        for sample in samples[:1000]:
            steering.update(sample)

    def thousand_with_filterpy() -> None:
        with_filterpy.reset(ARM.home)
        with_filterpy._palm = ReadablePalmFilter(with_filterpy.settings.palm_filter)
        for sample in samples[:1000]:
            with_filterpy.update(sample)

    step, slow_step = (seconds_per_call(steps) / 1000 for steps in (thousand, thousand_with_filterpy))
    np.testing.assert_allclose(steering.actuation, with_filterpy.actuation, atol=1e-9)
    whole = seconds_per_call(minute, repeats=3)
    return [
        Row("control step, whole", step * 1e6, "us", "period of the sensor: 8670 us", 8.67e-3 / step, 100.0),
        Row("control step, whole", step * 1e6, "us", f"with filterpy's filter: {slow_step * 1e6:.3g} us",
            slow_step / step, 100.0),
        Row("a recorded minute, replayed", whole, "s", "the minute: 60 s", 60.0 / whole, 1.0),
    ]  # fmt: skip


def palm_filter() -> list[Row]:
    """Time the filter of the palm on measurements of position and velocity."""
    filters = PalmFilter(), ReadablePalmFilter()
    position, velocity, interval = np.array([0.02, 0.2, 0.01]), np.array([0.1, 0.0, -0.05]), 8.67e-3

    def step(palm: PalmFilter) -> Callable[[], Any]:
        return lambda: palm.update((palm.time or 0.0) + interval, position, velocity)

    ours, theirs = map(step, filters)
    for _ in range(100):
        np.testing.assert_allclose(ours(), theirs(), atol=1e-12)
    return compare("palm filter, one measurement, Eqs. (6)-(12)", ours, {"filterpy, nine states": theirs})


def raw_daqp(pose: Any) -> Callable[[], Any]:
    """Return a call of daqp alone, on matrices that are already there."""
    problem = pose_step(pose, POSITION_STEP, DIRECTION_STEP, BOUNDS, WEIGHTS)
    sense = np.zeros(7, dtype=np.intc)
    return lambda: daqp.solve(
        problem.hessian, problem.gradient, problem.matrix, problem.upper, problem.lower, sense
    )


def cost(step: np.ndarray) -> tuple[float, np.ndarray]:
    """Return the nonlinear cost of a step in mm and N, and its gradient."""
    start, pose = KINEMATICS(ACTUATION), KINEMATICS(ACTUATION + step * BOUNDS.units)
    damping = np.array([WEIGHTS.slide_damping, *[WEIGHTS.damping] * 6])
    position = (pose.tip - start.tip - POSITION_STEP) * 1e3
    direction = (pose.direction - start.direction - DIRECTION_STEP) * WEIGHTS.direction
    value = position @ position + direction @ direction + np.sum((damping * step) ** 2)
    slope = position @ pose.tip_jacobian * 1e3 + direction @ pose.direction_jacobian * WEIGHTS.direction
    return float(value), 2 * (slope * BOUNDS.units + damping**2 * step)


def by_gradients() -> Any:
    """Solve the step without linearisation by sequential quadratic programming, gradients given."""
    return minimize(cost, np.zeros(7), jac=True, bounds=step_bounds(), method="SLSQP")


def by_differences() -> Any:
    """The same with gradients by differences, as the paper's solver takes them by default."""
    return minimize(lambda step: cost(step)[0], np.zeros(7), bounds=step_bounds(), method="SLSQP")


def step_bounds() -> list[tuple[float, float]]:
    """Return the bounds of the step in mm and N."""
    return list(zip(BOUNDS.lower / BOUNDS.units, BOUNDS.upper / BOUNDS.units))
