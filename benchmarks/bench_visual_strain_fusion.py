"""Learning estimator and compensator: time per step, against refitting scikit-learn's regressor."""

import time
from collections.abc import Callable

import numpy as np
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF

from benchmarks.run import Row, compare, seconds_per_call
from soro_lib.estimators.extreme_learning_machine import ExtremeLearningMachine
from soro_lib.estimators.gaussian_process import RollingGaussianProcess
from soro_lib.studies.visual_strain_fusion.hybrid_control import READINGS, compare_controllers
from soro_lib.studies.visual_strain_fusion.motion import glue_fibre, spiral

PERIOD_US = 5e4
WINDOW = 100
TABLE_READINGS = ("literal", "no learning")


def rows() -> list[Row]:
    """Measure the network, the Gaussian process and the runs behind Tables I and II."""
    return [_network(), *_gaussian_process(), *_tables()]


def _network() -> Row:
    rng = np.random.default_rng(1)
    motion = spiral(2000)
    shifts = glue_fibre(rng).shift(motion.configuration, motion.elongations, rng)
    network = ExtremeLearningMachine(rng)
    network.fit(shifts[:450], motion.pose[:450])

    def step() -> None:
        network.predict(shifts[1000])
        network.update(shifts[1000], motion.pose[1000])

    microseconds = 1e6 * seconds_per_call(step)
    return Row(
        "learning machine, predict and update (N = 200, 17 gratings)",
        microseconds,
        "us",
        "the paper's step: 50 ms",
        PERIOD_US / microseconds,
        150.0,
    )


def _gaussian_process() -> list[Row]:
    rng = np.random.default_rng(1)
    inputs = np.cumsum(rng.normal(0.0, 1e-4, (WINDOW, 5)), axis=0)
    outputs = rng.normal(0.0, 1e-3, (WINDOW, 2))
    rolling = RollingGaussianProcess(WINDOW, np.full(5, 2e-3), outputs=2, noise=0.3)
    for sample in zip(inputs, outputs):
        rolling.add(*sample)

    def ours() -> None:
        rolling.add(inputs[0], outputs[0])
        rolling.predict(inputs[-1])

    def refit() -> None:
        process = GaussianProcessRegressor(RBF(2e-3), alpha=0.09, optimizer=None, normalize_y=True)
        process.fit(inputs, outputs).predict(inputs[-1:])

    peers: dict[str, Callable[[], None] | None] = {"scikit-learn, refitted": refit}
    return compare(f"Gaussian process, one step at {WINDOW} samples", ours, peers, unit="ms", goal=1.0)


def _tables() -> list[Row]:
    readings = {name: READINGS[name] for name in TABLE_READINGS}
    start = time.perf_counter()
    for path in ("pentagram", "circle"):
        compare_controllers(path, np.random.default_rng(1), seeds=10, readings=readings)
    seconds = time.perf_counter() - start
    return [
        Row("Tables I and II, 10 seeds, 4 gains, with and without learning", seconds, "s", "none", None, 90.0)
    ]
