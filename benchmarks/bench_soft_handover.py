"""The handover without its cameras: filters, state optimisation, control step, plants, many handovers.

The optima of both solvers are the same (checked before anything is timed) on the same hundred states of a
sagging arm.
"""

import time
from collections.abc import Callable

import numpy as np
from filterpy.kalman import KalmanFilter

from benchmarks.run import Row, compare
from soro_lib.controllers import VirtualStiffnessController
from soro_lib.controllers.handover import HandoverController, Mode
from soro_lib.controllers.virtual_stiffness import reach_goal, state_limits, step_towards
from soro_lib.estimators import estimate_shape
from soro_lib.estimators.handover_filters import MEASURED_NOISE, FilterNoise, HandoverFilters
from soro_lib.estimators.shape_estimation import estimate_shape_by_slsqp
from soro_lib.papers.soft_handover.calibration import plant_k
from soro_lib.papers.soft_handover.experiments.handover import HOLDER, Blocks, handovers, thesis_parameters
from soro_lib.papers.soft_handover.world.observer import NoisyObserver, load_vision_noise
from soro_lib.papers.soft_handover.world.plant import ElasticPlant
from soro_lib.robots import HelixArm
from soro_lib.sensing.handover_observation import HandoverObservation

ARM = HelixArm()
CASES = 100


def rows() -> list[Row]:
    """Return the comparisons of the handover."""
    return [
        *filters(),
        *state_optimisation(),
        *inner_loop(),
        control_step(),
        equilibrium(),
        handovers_per_minute(),
    ]


def filters() -> list[Row]:
    """Time the filters of ball, wrist and direction over one look against filterpy's, all three seen."""
    points = ARM.tip_points(ARM.home)
    direction = (points[3:] - points[:3]) / np.linalg.norm(points[3:] - points[:3])
    look = HandoverObservation(points[:3] + 0.001, direction, points[3:] + 0.1)
    move, still = np.full(6, 0.002), np.zeros(3)
    ours = HandoverFilters(MEASURED_NOISE, points)

    def step() -> np.ndarray:
        ours.predict(move)
        ours.update(look)
        return ours.points

    parts = [
        filterpys_point(MEASURED_NOISE.ball, points[3:], still, look.ball, look.ball_deviation),
        filterpys_point(MEASURED_NOISE.wrist, points[:3], move[:3], look.wrist, look.wrist_deviation),
        filterpys_point(MEASURED_NOISE.direction, direction, still, direction, look.direction_deviation),
    ]

    def theirs() -> np.ndarray:
        _, wrist, towards = (part() for part in parts)
        return np.concatenate([wrist, wrist + ours.gripper_length * towards / np.linalg.norm(towards)])

    for _ in range(100):
        np.testing.assert_allclose(step(), theirs(), atol=1e-12)
    return compare("filters of ball, wrist and direction, one look", step, {"filterpy": theirs})


def filterpys_point(
    noise: FilterNoise, start: np.ndarray, move: np.ndarray, measured: np.ndarray | None, deviation: float
) -> Callable[[], np.ndarray]:
    """Return one prediction and update of filterpy's filter of a point (3,), which returns the point."""
    reference = KalmanFilter(dim_x=3, dim_z=3)
    reference.x, reference.P = start, noise.initial * np.eye(3)
    reference.F = reference.H = reference.B = np.eye(3)
    reference.Q = (noise.process + noise.move_deviation**2 * float(move @ move)) * np.eye(3)
    reference.R = deviation**2 * np.eye(3)

    def step() -> np.ndarray:
        reference.predict(u=noise.expected_move * move)
        reference.update(measured)
        return reference.x

    return step


def state_optimisation() -> list[Row]:
    """Time a hundred state optimisations against SLSQP with analytic gradients."""
    rng = np.random.default_rng(1)
    plant = plant_k()
    cases = []
    for _ in range(CASES):
        commanded = rng.uniform(0.7 * ARM.lower + 0.3 * ARM.home, 0.7 * ARM.upper + 0.3 * ARM.home)
        cases.append((commanded, ARM.tip_points(plant.settle(ARM.tendon_lengths(commanded)))))
    for case in cases:
        np.testing.assert_allclose(estimate_shape(*case).q, estimate_shape_by_slsqp(*case).q, atol=1e-5)
    return compare(
        f"state optimisation, Eq. (16), {CASES} states",
        lambda: [estimate_shape(*case) for case in cases],
        {
            "SciPy SLSQP, analytic gradients (goal: 20 times)": lambda: [
                estimate_shape_by_slsqp(*case) for case in cases
            ]
        },
        "ms",
    )


def inner_loop() -> list[Row]:
    """Time Algorithm 1 against its outer loop uncompiled."""
    control = VirtualStiffnessController(step_size=0.4)
    measured = ARM.tip_points(ARM.home)
    goal = measured + np.array([0.15, 0, -0.06, 0.15, 0, -0.06])
    arguments = (
        ARM.home, ARM.home, step_towards(measured, goal, 0.4), measured, 1 / np.array(control.stiffness),
        *state_limits(ARM), 0.005, 20, False, False, 0.1,
    )  # fmt: skip
    return compare(
        "20 iterations, Algorithm 1",
        lambda: reach_goal(*arguments),
        {"its outer loop without numba": lambda: reach_goal.py_func(*arguments)},
    )


def control_step() -> Row:
    """Time control steps (filters, state optimisation, Algorithm 1, tendons) over whole handovers; the
    median."""
    eyes, plant, rng = NoisyObserver(load_vision_noise("thesis")), plant_k(), np.random.default_rng(1)
    controller = HandoverController(thesis_parameters(0.2))
    calibrated = ARM.tendon_lengths(ARM.home)
    durations = []
    for _ in range(20):
        for part in (controller, eyes, plant):
            part.reset()
        ball = HOLDER.ball("front", rng)
        state = plant.settle(calibrated)
        for _ in range(60):
            look = eyes.observe(state, ball, rng)
            start = time.process_time()
            command = controller.update(look)
            durations.append(time.process_time() - start)
            if command.mode is Mode.GRASP:
                break
            state = plant.settle(calibrated + command.tendon_change)
    median, slow = 1e3 * np.percentile(durations, [50, 95])
    return Row(
        "control step without cameras, median", float(median), "ms", f"95 % within {slow:.2f} ms", None, 0.5
    )


def equilibrium() -> Row:
    """Time plant E following a random walk of commands; the median."""
    plant, rng, durations = ElasticPlant(), np.random.default_rng(1), []
    command = ARM.home.copy()
    for _ in range(300):
        command = ARM.clip(command + 0.03 * rng.standard_normal(9) * np.tile([1, 1, 0.1], 3)).actuation
        tendons = ARM.tendon_lengths(command)
        start = time.process_time()
        plant.settle(tendons)
        durations.append(time.process_time() - start)
    return Row(
        "plant E, one equilibrium, median", 1e3 * float(np.median(durations)), "ms", "no peer", None, 1.0
    )


def handovers_per_minute() -> Row:
    """Time two hundred whole handovers on plant K at step size 0.1, the slowest."""
    start = time.process_time()
    handovers(thesis_parameters(0.1), plant_k(), Blocks(NoisyObserver(load_vision_noise("thesis")), 25, 1))
    return Row("200 handovers without rendering", time.process_time() - start, "s", "one core", None, 60.0)
