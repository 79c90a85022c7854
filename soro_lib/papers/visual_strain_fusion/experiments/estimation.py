"""The fibre and its estimator: what it can know, how it learns, what blows up (Wang et al., Sec. IV-C).

Every experiment keeps both errors: of the prediction before a sample is learned (a priori), and of what
remains after it (a posteriori). The second is small for any network that follows its labels, noise and all.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from soro_lib.estimators.extreme_learning_machine import ExtremeLearningMachine
from soro_lib.papers.visual_strain_fusion.world.motion import PERIOD, ArmMotion, glued_shifts, spiral

Array = NDArray[np.float64]

LABEL_NOISE = (0.38e-3, 0.45e-3, 0.29e-3)
"""Standard deviation of camera labels along x, y, z where no recording is used [m]."""
INITIAL_SAMPLES = 450

ROUNDING_LIMIT = 1e10
"""Condition number, or trace of H, of which rounding leaves about six digits: 1e10 times 2e-16 [-].

Beyond it the number, and what a network learns with it, differs visibly from processor to processor.
"""
DIVERGED = 1.0
"""Largest position error of a network that has not diverged [m]: many times the reach of the arm."""
UNRESOLVED_DIGITS = 3
"""Digits of an error that are the same on every processor though the trace passed `ROUNDING_LIMIT`."""

NETWORKS: dict[str, dict[str, Any]] = {
    "default": {},
    "no forgetting": {"forgetting": 1.0},
    "stiffer, ridge 1e-2": {"regularisation": 1e-2},
    "softer, ridge 1e-6": {"regularisation": 1e-6},
    "narrow nodes": {"width_range": (0.2, 2.0)},
    "w = 0.995, bounded": {"forgetting": 0.995},
    "w = 0.995, unbounded": {"forgetting": 0.995, "maximum_trace": np.inf},
    "w = 0.98, unbounded": {"forgetting": 0.98, "maximum_trace": np.inf},
    "inputs in nm, not scaled": {"input_scale": 1e-9},
}
"""Settings that differ from the default in one respect each."""


@dataclass(frozen=True)
class LearningRun:
    """Record of a network that learns online; ``n`` steps after the first solution.

    Attributes
    ----------
    step : ndarray (n,)
        Step of the motion.
    prior : ndarray (n,)
        Distance of the prediction from the true position, before learning [m].
    prior_to_label, posterior_to_label : ndarray (n, 3)
        Prediction error against the label per axis, before and after learning it [m].
    trace : ndarray (n,)
        Trace of the covariance [-].
    condition : float
        Condition number of the first normal matrix [-].
    """

    step: NDArray[np.int64]
    prior: Array
    prior_to_label: Array
    posterior_to_label: Array
    trace: Array
    condition: float

    @property
    def resolved(self) -> NDArray[np.bool_]:
        """Steps ``(n,)`` before the trace passes `ROUNDING_LIMIT` or H loses its positive definiteness."""
        return np.logical_and.accumulate((self.trace > 0.0) & (self.trace < ROUNDING_LIMIT))

    @property
    def diverged(self) -> bool:
        """Whether the distance from the true position ever exceeds `DIVERGED`."""
        return not self.prior.max() <= DIVERGED


def measure(motion: ArmMotion, rng: np.random.Generator, labels: Array | None = None) -> tuple[Array, Array]:
    """Wavelength shifts ``(n, gratings)`` [m] of a newly glued fibre and camera labels ``(n, 7)`` [m, -].

    The labels are those given, else the true poses with white position noise.
    """
    shifts = glued_shifts(motion, rng)
    if labels is None:
        labels = motion.pose.copy()
        labels[:, :3] += rng.normal(0.0, LABEL_NOISE, (len(labels), 3))
    return shifts, labels


def learn_online(
    network: ExtremeLearningMachine,
    shifts: Array,
    labels: Array,
    truth: Array,
    initial: int = INITIAL_SAMPLES,
) -> LearningRun:
    """Solve on the first samples, then predict and learn one by one.

    Parameters
    ----------
    network : ExtremeLearningMachine
        Trained in place.
    shifts : ndarray (n, gratings)
        Wavelength shifts [m].
    labels, truth : ndarray (n, 7)
        Camera poses and true poses [m, -].
    initial : int
        Samples N0 of the first solution.
    """
    hidden = network.hidden_output(shifts[:initial])
    network.fit(shifts[:initial], labels[:initial])
    steps = np.arange(initial, len(shifts))
    prior, trace = np.empty((2, len(steps)))
    before, after = np.empty((2, len(steps), 3))
    for row, step in enumerate(steps):
        prediction = network.predict(shifts[step])[:3]
        prior[row] = np.sqrt(np.sum((prediction - truth[step, :3]) ** 2))
        before[row] = labels[step, :3] - prediction
        after[row] = network.update(shifts[step], labels[step]).posterior_error[:3]
        trace[row] = network.trace
    condition = float(np.linalg.cond(hidden.T @ hidden))
    return LearningRun(steps, prior, before, after, trace, condition)


def compare_networks(
    seed: int,
    *,
    seeds: int = 5,
    networks: Mapping[str, Mapping[str, Any]] = NETWORKS,
    steps: int = 4000,
    labels: Array | None = None,
) -> pd.DataFrame:
    """Run every network setting on the same spirals.

    Parameters
    ----------
    seed : int
        Seed of fibres, nodes and noise.
    seeds : int
        Number of fibres.
    networks : mapping
        Settings by name.
    steps : int
        Samples of the spiral.
    labels : ndarray (steps, 7), optional
        Recorded camera poses of it; white noise about the truth without them [m, -].

    Returns
    -------
    pandas.DataFrame
        Columns network, seed, prior_mean_mm, prior_max_mm (to the truth), prior_label_mm, posterior_label_mm
        (to the labels), their components ``prior_x_mm`` ..., trace, condition. What rounding decides is
        infinite: errors of a network that diverged, a trace or condition beyond `ROUNDING_LIMIT`.
    """
    motion = spiral(steps)
    rows = []
    for number, rng in enumerate(np.random.default_rng(seed).spawn(seeds)):
        shifts, seen = measure(motion, rng, labels)
        nodes = rng.integers(2**32)
        for name, settings in networks.items():
            network = ExtremeLearningMachine(np.random.default_rng(nodes), **settings)
            run = learn_online(network, shifts, seen, motion.pose)
            rows.append({"network": name, "seed": number, **_errors(run)})
    return pd.DataFrame(rows)


def _errors(run: LearningRun) -> dict[str, float]:
    errors = {
        "prior_mean": run.prior.mean(),
        "prior_max": run.prior.max(),
        "prior_label": np.linalg.norm(run.prior_to_label, axis=1).mean(),
        "posterior_label": np.linalg.norm(run.posterior_to_label, axis=1).mean(),
        **{f"prior_{axis}": np.abs(run.prior_to_label[:, n]).mean() for n, axis in enumerate("xyz")},
    }
    resolved = bool(run.resolved.all())
    return {
        **{f"{name}_mm": _steady(1e3 * float(error), run, resolved) for name, error in errors.items()},
        "trace": float(run.trace[-1]) if resolved else np.inf,
        "condition": run.condition if run.condition < ROUNDING_LIMIT else np.inf,
    }


def _steady(error: float, run: LearningRun, resolved: bool) -> float:
    """Return what every processor agrees on of an error: all of it, its first digits, or that it is large."""
    if run.diverged:
        return np.inf
    return error if resolved else float(f"{error:.{UNRESOLVED_DIGITS}g}")


def settings_table(networks: pd.DataFrame) -> pd.DataFrame:
    """Means over the seeds of `compare_networks`, as text: six digits, or words for what rounding decides.

    "diverged" is an error beyond `DIVERGED`, "beyond 1e+10" a trace or a condition beyond
    `ROUNDING_LIMIT`; a network whose trace is beyond it has `UNRESOLVED_DIGITS` digits of its errors.
    """
    errors = [f"{error}_mm" for error in ("prior_mean", "prior_max", "prior_label", "posterior_label")]
    columns = [*errors, "trace", "condition"]
    means = networks.groupby("network", sort=False)[columns].mean()
    digits = np.where(np.isfinite(means["trace"]), 6, UNRESOLVED_DIGITS)
    words = dict.fromkeys(("trace", "condition"), f"beyond {ROUNDING_LIMIT:.0e}")
    text = {
        column: [
            f"{value:.{count}g}" if np.isfinite(value) else words.get(column, "diverged")
            for value, count in zip(means[column], digits)
        ]
        for column in columns
    }
    return pd.DataFrame(text, index=means.index).reset_index()


def window_errors(
    seed: int, windows: Sequence[int] = (100, 150, 190, 250, 450), every: int = 25
) -> pd.DataFrame:
    """Errors before and after learning for a network that is solved afresh on its newest samples only.

    This is the windowed scheme that the name FOS-ELM stands for elsewhere (Erratum VS-4). With fewer samples
    than nodes it interpolates its labels: the error after learning vanishes, the one before does not.

    Returns
    -------
    pandas.DataFrame
        Columns window, prior_label_mm, posterior_label_mm.
    """
    rng = np.random.default_rng(seed)
    shifts, labels = measure(spiral(), rng)
    labels = labels[:, :3]
    hidden = ExtremeLearningMachine(rng).hidden_output(shifts)
    rows = []
    for window in windows:
        before, after = [], []
        for step in range(max(windows), len(shifts) - 1, every):
            newest = slice(step - window, step + 1)
            weights = np.linalg.lstsq(hidden[newest], labels[newest])[0]
            after.append(np.linalg.norm(hidden[step] @ weights - labels[step]))
            before.append(np.linalg.norm(hidden[step + 1] @ weights - labels[step + 1]))
        rows.append((window, 1e3 * np.mean(before), 1e3 * np.mean(after)))
    return pd.DataFrame(rows, columns=["window", "prior_label_mm", "posterior_label_mm"])


HOLD_NETWORKS: dict[str, dict[str, Any]] = {
    "w = 0.99, unbounded": {"forgetting": 0.99, "maximum_trace": np.inf},
    "w = 0.99, bounded": {"forgetting": 0.99},
    "no forgetting": {"forgetting": 1.0},
}
"""Settings of the networks that are held still."""

HOLD_START = 900
"""Step of the spiral at which `hold_still` stops: the network has followed its labels for 450 steps."""
HOLD_STEPS = 2000


def hold_still(seed: int) -> dict[str, LearningRun]:
    """Follow the spiral, stand still, then go on: forgetting with narrow excitation.

    While the arm stands still every sample says the same; what it says nothing about is forgotten, and the
    covariance of those directions grows exponentially unless it is bounded.
    """
    motion = spiral(3000, (HOLD_START, HOLD_STEPS))
    rng = np.random.default_rng(seed)
    shifts, labels = measure(motion, rng)
    nodes = rng.integers(2**32)
    runs = {}
    for name, settings in HOLD_NETWORKS.items():
        network = ExtremeLearningMachine(np.random.default_rng(nodes), **settings)
        runs[name] = learn_online(network, shifts, labels, motion.pose)
    return runs


def initial_samples(
    seed: int, *, seeds: int = 5, counts: Sequence[int] = (250, 450, 900, 1800)
) -> pd.DataFrame:
    """How well the first solution predicts what comes next, by the number of its samples.

    Returns
    -------
    pandas.DataFrame
        Columns samples, seed, next_mm (mean error over the next 10 s without learning), frozen_mm (over all
        the rest of the spiral without learning), learning_mm (over the rest, learning on).
    """
    motion = spiral()
    rows = []
    for number, rng in enumerate(np.random.default_rng(seed).spawn(seeds)):
        shifts, labels = measure(motion, rng)
        nodes = rng.integers(2**32)
        for count in counts:
            frozen = ExtremeLearningMachine(np.random.default_rng(nodes))
            frozen.fit(shifts[:count], labels[:count])
            error = np.linalg.norm(frozen.predict(shifts[count:])[:, :3] - motion.pose[count:, :3], axis=1)
            learner = ExtremeLearningMachine(np.random.default_rng(nodes))
            learning = learn_online(learner, shifts, labels, motion.pose, count)
            means = error[: round(10.0 / PERIOD)].mean(), error.mean(), learning.prior.mean()
            rows.append((count, number, *(1e3 * mean for mean in means)))
    return pd.DataFrame(rows, columns=["samples", "seed", "next_mm", "frozen_mm", "learning_mm"])


def blackout(seed: int, *, seeds: int = 5) -> pd.DataFrame:
    """Error of the fibre alone while the camera is away, on the outer spiral.

    Returns
    -------
    pandas.DataFrame
        Columns seconds, seed, mean_mm, max_mm.
    """
    motion = spiral()
    rows = []
    for number, rng in enumerate(np.random.default_rng(seed).spawn(seeds)):
        shifts, labels = measure(motion, rng)
        for start in (2400, 3000, 3600):
            network = ExtremeLearningMachine(np.random.default_rng(number))
            network.fit(shifts[:start], labels[:start])
            for length in (2.0, 5.0, 10.0):
                rest = slice(start, start + round(length / PERIOD))
                error = np.linalg.norm(network.predict(shifts[rest])[:, :3] - motion.pose[rest, :3], axis=1)
                rows.append((length, number, 1e3 * error.mean(), 1e3 * error.max()))
    table = pd.DataFrame(rows, columns=["seconds", "seed", "mean_mm", "max_mm"])
    return table.groupby(["seconds", "seed"], as_index=False).mean()
