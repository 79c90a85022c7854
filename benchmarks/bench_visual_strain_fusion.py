"""Learning estimator, fusion and compensator: time per step against plain numpy, filterpy, scikit-learn."""

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from filterpy.kalman import KalmanFilter
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF

from benchmarks.run import Row, compare, seconds_per_call
from soro_lib.estimators.extreme_learning_machine import ExtremeLearningMachine
from soro_lib.estimators.gaussian_process import RollingGaussianProcess
from soro_lib.estimators.pose_fusion import InverseVarianceFusion, blend_poses
from soro_lib.papers.visual_strain_fusion.experiments.hybrid_control import READINGS, compare_controllers
from soro_lib.papers.visual_strain_fusion.world.motion import glue_fibre, spiral

PERIOD_US = 5e4
WINDOW = 100
TABLE_READINGS = ("literal", "no learning")


def rows() -> list[Row]:
    """Measure the network, the fusion, the Gaussian process and the runs behind Tables I and II."""
    return [*_network(), *_fusion(), *_gaussian_process(), *_tables()]


def _network() -> list[Row]:
    rng = np.random.default_rng(1)
    motion = spiral(2000)
    shifts = glue_fibre(rng).shift(motion.configuration, motion.elongations, rng)
    network = ExtremeLearningMachine(rng)
    network.fit(shifts[:450], motion.pose[:450])

    def step() -> None:
        network.predict(shifts[1000])
        network.update(shifts[1000], motion.pose[1000])

    plain = _plain_least_squares(network)
    np.testing.assert_allclose(
        plain(shifts[999], motion.pose[999]), network.update(shifts[999], motion.pose[999]).prior_error
    )
    name = "learning machine, predict and update (N = 200, 17 gratings)"
    own = seconds_per_call(step) * 1e6
    return [
        Row(name, own, "us", "the paper's step: 50 ms", PERIOD_US / own, 150.0),
        *compare(
            "learning machine, update",
            lambda: network.update(shifts[1000], motion.pose[1000]),
            {"recursive least squares in plain numpy": lambda: plain(shifts[1000], motion.pose[1000])},
        ),
    ]


def _plain_least_squares(network: ExtremeLearningMachine) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
    """Return the update of a copy of a network as Eqs. (3), (10)-(17) say it; it returns the prior error."""
    weights, covariance, forgetting = network.weights.copy(), network.covariance, network.forgetting

    def update(shift: np.ndarray, pose: np.ndarray) -> np.ndarray:
        nonlocal weights, covariance
        squared = np.sum((shift / network.input_scale - network.centres) ** 2, axis=1)
        hidden = np.exp(-squared / network.widths)
        direction = covariance @ hidden
        gain = direction / (forgetting + hidden @ direction)
        innovation = pose - hidden @ weights
        weights = weights + np.outer(gain, innovation)
        covariance = (covariance - np.outer(gain, direction)) / forgetting
        if np.trace(covariance) > network.maximum_trace:
            covariance = covariance * forgetting
        return innovation

    return update


def _fusion() -> list[Row]:
    """Time the fusion by inverse variances; the peer has the same gate and blends orientations alike."""
    period, acceleration = 0.05, 0.05
    camera, fibre = np.array([0.0, 0, 0, 0, 0, 0, 1]), np.array([1e-4, 0, 0, 0, 0, 0, 1])
    variances = 1e-7, 4e-7
    fusion = InverseVarianceFusion(period, acceleration)
    reference = KalmanFilter(dim_x=6, dim_z=3)
    reference.F[:3, 3:], reference.H[:, :3] = period * np.eye(3), np.eye(3)
    effect = np.vstack([0.5 * period**2 * np.eye(3), period * np.eye(3)])
    reference.Q = acceleration**2 * effect @ effect.T
    reference.x, reference.P = np.zeros((6, 1)), np.diag([variances[0]] * 3 + [1e-4] * 3)

    def ours() -> np.ndarray:
        return fusion.update(camera, variances[0], fibre, variances[1])

    def theirs() -> np.ndarray:
        reference.predict()
        for pose, variance in zip((camera, fibre), variances):
            innovation, noise = pose[:3, None] - reference.x[:3], variance * np.eye(3)
            if innovation.T @ np.linalg.inv(reference.P[:3, :3] + noise) @ innovation <= fusion.gate:
                reference.update(pose[:3, None], R=noise)
        pose = blend_poses(camera, fibre, variances[0] / sum(variances))
        return np.concatenate([reference.x[:3, 0], pose[3:]])

    for _ in range(100):
        np.testing.assert_allclose(ours(), theirs(), atol=1e-12)
    return compare("fusion by inverse variances, one pair", ours, {"filterpy, six states": theirs})


def _gaussian_process() -> list[Row]:
    rng = np.random.default_rng(1)
    inputs = np.cumsum(rng.normal(0.0, 1e-4, (WINDOW, 5)), axis=0)
    outputs = rng.normal(0.0, 1e-3, (WINDOW, 2))
    rolling = RollingGaussianProcess(WINDOW, np.full(5, 2e-3), outputs=2, noise=0.3)
    for sample in zip(inputs, outputs):
        rolling.add(*sample)

    def ours() -> np.ndarray:
        rolling.add(inputs[rolling.count % WINDOW], outputs[rolling.count % WINDOW])
        return rolling.predict(inputs[-1])

    def refit() -> np.ndarray:
        process = GaussianProcessRegressor(RBF(2e-3), alpha=0.09, optimizer=None, normalize_y=True)
        return process.fit(inputs, outputs).predict(inputs[-1:])[0]

    def inverted() -> np.ndarray:
        apart = (inputs[:, None] - inputs) / 2e-3
        inverse = np.linalg.inv(np.exp(-0.5 * np.sum(apart**2, axis=2)) + 0.09 * np.eye(WINDOW))
        correlation = np.exp(-0.5 * np.sum(((inputs - inputs[-1]) / 2e-3) ** 2, axis=1))
        mean = outputs.mean(axis=0)
        return mean + correlation @ inverse @ (outputs - mean)

    for peer in (refit, inverted):
        np.testing.assert_allclose(ours(), peer(), atol=1e-9)
    peers: dict[str, Callable[[], Any] | None] = {
        "scikit-learn, refitted": refit,
        "plain numpy, inverted": inverted,
    }
    return compare(f"Gaussian process, one step at {WINDOW} samples", ours, peers, unit="ms", goal=1.0)


def _tables() -> list[Row]:
    readings = {name: READINGS[name] for name in TABLE_READINGS}
    start = time.process_time()
    for path in ("pentagram", "circle"):
        compare_controllers(path, np.random.default_rng(1), seeds=10, readings=readings)
    seconds = time.process_time() - start
    return [
        Row("Tables I and II, 10 seeds, 4 gains, with and without learning", seconds, "s", "none", None, 90.0)
    ]
