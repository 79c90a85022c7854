"""Fusing the stored camera flights with a simulated fibre (Wang et al., Secs. IV-B and IV-C).

The camera is one recording per scene; every seed glues another fibre, draws other hidden nodes and other
wavelength noise. Four estimates stand side by side: the camera alone, the fibre alone, Eq. (18) with the
reprojection error as printed and with it weighted by the inliers, and a gated inverse-variance filter.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.stats import chi2, mannwhitneyu
from threadpoolctl import threadpool_limits

from soro_lib.estimators import pose_fusion
from soro_lib.estimators.extreme_learning_machine import ExtremeLearningMachine
from soro_lib.estimators.visual_strain import VisualStrainEstimator, VisualStrainSettings
from soro_lib.papers.visual_strain_fusion.experiments.camera_runs import load_flight
from soro_lib.papers.visual_strain_fusion.world.motion import ArmMotion, glued_shifts, spiral
from soro_lib.sensing.monocular_vision import fit_similarity

Array = NDArray[np.float64]

SETTINGS = VisualStrainSettings()
"""Inlier-weighted reading of Eq. (18); chosen on scene 1."""

PRINTED_BOUNDS = {"lower": 1.0, "upper": 1.4}
"""E_L and E_U [px] for the mean error of the inliers; 1.4 is the paper's threshold, 1.0 chosen on scene 1."""

CAMERA_BIAS = 0.4e-3
"""Standard deviation per axis of the slow drift of the map [m]; chosen on scene 1, for the filter only."""

ESTIMATES = {
    "camera": "camera alone",
    "fibre": "fibre alone",
    "printed": "Eq. (18), mean error of the inliers",
    "fused": "Eq. (18), inlier-weighted error",
    "filter": "inverse-variance filter",
}
"""Estimates by name, as columns of the run, and what they are."""

SEEN = ["x_mm", "y_mm", "z_mm"]
TRUE = ["true_x_mm", "true_y_mm", "true_z_mm"]
POSE = [*SEEN, "qx", "qy", "qz", "qw"]
"""Columns of a flight: tip position by the camera, the true one, and the camera's whole pose."""

POSE_UNITS = np.array([1e3, 1e3, 1e3, 1.0, 1.0, 1.0, 1.0])
"""What a pose [m, -] is multiplied by to fill these columns."""

Windows = dict[str, Callable[[pd.DataFrame], pd.Series]]
"""Parts of a run: masks of its frames, by name."""

WINDOWS: Windows = {
    "whole run": lambda run: run.time_s >= 0,
    "clean (0-100 s)": lambda run: run.time_s < 100,
    "first 50 s": lambda run: run.time_s < 50,
    "last 25 s": lambda run: run.time_s >= 175,
    "hand in view": lambda run: run.phase.isin([2, 3]),
    "full cover": lambda run: run.phase == 4,
}
"""Parts of the obstacle test."""

LIGHT_WINDOWS: Windows = {
    "whole run": lambda run: run.time_s >= 0,
    "ordinary light": lambda run: run.phase == 1,
    "weak or no light": lambda run: run.phase == 2,
    "moving lamp": lambda run: run.phase == 3,
}
"""Parts of the light test."""


def camera_poses(frames: pd.DataFrame) -> Array:
    """Return the camera's poses (n, 7) of a flight: position [m] and scalar-last quaternion."""
    return frames[POSE].to_numpy() / POSE_UNITS


def fused_poses(run: pd.DataFrame) -> Array:
    """Return the fused poses (n, 7) of a run of :func:`fuse_flight`: position [m] and quaternion."""
    return run[[f"fused_{column}" for column in POSE]].to_numpy() / POSE_UNITS


def camera_variance(frames: pd.DataFrame) -> Array:
    """Return the variance per axis (n,) [m^2] that the filter gives the camera; infinite where it is lost.

    The scatter is that of the perspective-n-point solution; the drift of the map, which no single frame
    shows, is added as a constant.
    """
    variance = (frames["spread_mm"].to_numpy() / 1e3) ** 2 / 3 + CAMERA_BIAS**2
    return np.where(frames["tracked"].to_numpy() > 0, variance, np.inf)


def fuse_flight(frames: pd.DataFrame, motion: ArmMotion, rng: np.random.Generator) -> pd.DataFrame:
    """Let a new fibre learn from a stored flight and fuse the two.

    Parameters
    ----------
    frames : DataFrame
        A flight, as from :func:`~soro_lib.papers.visual_strain_fusion.experiments.camera_runs.load_flight`.
    motion : ArmMotion
        The motion that was flown.
    rng : numpy.random.Generator
        Draws the gluing of the fibre, the hidden nodes and the noise of the wavelengths.

    Returns
    -------
    DataFrame
        Per frame: time_s, phase, tracked, step_mm, weight (of the fibre, in the inlier-weighted reading); for
        every estimate of :data:`ESTIMATES` ``<name>_x_mm``, ``_y_mm``, ``_z_mm``, ``<name>_qx`` ... ``_qw``
        and ``<name>_mm`` (distance from the truth); and the squared Mahalanobis distances of the filter's
        error in its own covariance (filter_distance) and in that plus the drift of the map
        (filter_drift_distance). Until the fibre has learned, its columns repeat the camera.

    Raises
    ------
    ValueError
        If the motion is not the one that was flown.
    """
    flown = frames[TRUE].to_numpy()
    truth = motion.pose[: len(frames)]
    if len(truth) < len(frames) or np.abs(1e3 * truth[:, :3] - flown).max() > 1e-3:
        raise ValueError("the motion is not the one that was flown: render the recordings again (make data)")
    camera, lost = camera_poses(frames), frames["tracked"].to_numpy() == 0
    shifts = glued_shifts(motion, rng)
    estimator = VisualStrainEstimator(ExtremeLearningMachine(rng), SETTINGS)
    error = np.where(lost, np.inf, frames["match_error_px"].to_numpy())
    inliers = frames["inliers"].to_numpy()
    estimates = [
        estimator.update(time, shift, None if gone else pose, size, count)
        for time, shift, gone, pose, size, count in zip(motion.time, shifts, lost, camera, error, inliers)
    ]
    learned = np.array([estimate.fibre_pose for estimate in estimates])
    fibre = np.where(np.isfinite(learned), learned, camera)
    fibre_variance = np.array([estimate.fibre_variance for estimate in estimates])
    printed_error = np.where(np.isfinite(learned[:, 0]), frames["inlier_error_px"].fillna(np.inf), 0.0)
    filtered, covariance = _filter(camera, camera_variance(frames), fibre, fibre_variance)
    filter_error = (filtered - truth)[:, :3]
    poses = {
        "camera": camera,
        "fibre": fibre,
        "printed": pose_fusion.fuse_poses(camera, fibre, printed_error, **PRINTED_BOUNDS),
        "fused": np.array([estimate.pose for estimate in estimates]),
        "filter": filtered,
    }
    weighted = np.array([estimate.error for estimate in estimates])
    run: dict[str, Any] = {
        "time_s": motion.time[: len(frames)],
        "phase": frames["phase"].to_numpy(),
        "tracked": 1 - lost,
        "step_mm": 1e3 * np.linalg.norm(np.diff(truth[:, :3], axis=0, prepend=truth[:1, :3]), axis=1),
        "weight": pose_fusion.fibre_weight(weighted, SETTINGS.lower, SETTINGS.upper),
        "filter_distance": _squared_distance(filter_error, covariance),
        "filter_drift_distance": _squared_distance(filter_error, covariance + CAMERA_BIAS**2 * np.eye(3)),
    }
    for name, pose in poses.items():
        run |= {f"{name}_{column}": values for column, values in zip(POSE, (POSE_UNITS * pose).T)}
        run[f"{name}_mm"] = 1e3 * np.linalg.norm(pose[:, :3] - truth[:, :3], axis=1)
    return pd.DataFrame(run)


def blind(frames: pd.DataFrame, start: float, duration: float) -> pd.DataFrame:
    """Return the flight with the camera lost for a while: it holds its last pose and is found again at once.

    Parameters
    ----------
    frames : DataFrame
        A flight.
    start, duration : float
        When, and for how long [s].
    """
    lost = frames["time_s"].between(start, start + duration, inclusive="left")
    blinded = frames.copy()
    blinded.loc[lost, ["tracked", "matches", "inliers"]] = 0
    blinded.loc[lost, ["inlier_error_px", "match_error_px", "spread_mm"]] = np.nan
    if lost.any():
        last = max(int(np.argmax(lost)) - 1, 0)
        blinded.loc[lost, POSE] = frames[POSE].iloc[last].to_numpy()
    return blinded


def _filter(camera: Array, camera_spread: Array, fibre: Array, fibre_spread: Array) -> tuple[Array, Array]:
    """Return the poses (n, 7) of the inverse-variance filter and its position covariances (n, 3, 3)."""
    fusion = pose_fusion.InverseVarianceFusion()
    poses, covariance = np.empty_like(camera), np.empty((len(camera), 3, 3))
    for step in range(len(camera)):
        poses[step] = fusion.update(camera[step], camera_spread[step], fibre[step], fibre_spread[step])
        covariance[step] = fusion.covariance
    return poses, covariance


def _squared_distance(error: Array, covariance: Array) -> Array:
    """Return the squared Mahalanobis distances (n,) of errors (n, 3)."""
    return np.einsum("ni,ni->n", error, np.linalg.solve(covariance, error[..., None])[..., 0])


def fuse_flights(names: Sequence[str], rng: np.random.Generator, seeds: int = 10) -> pd.DataFrame:
    """Fuse several flights with several fibres each.

    Parameters
    ----------
    names : sequence of str
        Flights.
    rng : numpy.random.Generator
        Spawns one generator per flight and fibre.
    seeds : int, optional
        Fibres per flight.

    Returns
    -------
    DataFrame
        The runs of :func:`fuse_flight` below each other, with columns flight and fibre_number.
    """
    motion, runs = spiral(), []
    with threadpool_limits(1):  # matrices of 200 x 200: threads would only get in each other's way
        for name in names:
            frames = load_flight(name)
            for number, generator in enumerate(rng.spawn(seeds)):
                runs.append(fuse_flight(frames, motion, generator).assign(flight=name, fibre_number=number))
    return pd.concat(runs, ignore_index=True)


def camera_accuracy() -> pd.DataFrame:
    """Return the errors of undisturbed flights: as they are, and with Eq. (30) fitted to the whole flight.

    Returns
    -------
    DataFrame
        Columns flight, calibration ("sweep before" or "whole flight"), mean absolute errors per axis, mean,
        RMSE and largest distance [mm], mean features and inliers.
    """
    rows = []
    for name in ("scene1_undisturbed", "scene2_undisturbed"):
        frames = load_flight(name)
        seen, truth = frames[SEEN].to_numpy(), frames[TRUE].to_numpy()
        counts = frames["features"].mean(), frames["inliers"].mean()
        rotation, scale, translation = fit_similarity(seen, truth)
        again = scale * seen @ rotation.T + translation
        for calibration, error in (("sweep before", seen - truth), ("whole flight", again - truth)):
            distance = np.linalg.norm(error, axis=1)
            summary = distance.mean(), np.sqrt(np.mean(distance**2)), distance.max()
            rows.append((name, calibration, *np.abs(error).mean(axis=0), *summary, *counts))
    columns = ["flight", "calibration", "mae_x_mm", "mae_y_mm", "mae_z_mm", "mean_mm", "rmse_mm", "max_mm"]
    return pd.DataFrame(rows, columns=[*columns, "features", "inliers"])


def camera_errors(frames: pd.DataFrame) -> Array:
    """Return the errors (n, 3) [mm] of the camera's positions in a flight."""
    return frames[SEEN].to_numpy() - frames[TRUE].to_numpy()


def window_errors(runs: pd.DataFrame, windows: Windows = WINDOWS) -> pd.DataFrame:
    """Return errors per flight, fibre, window and estimate.

    Parameters
    ----------
    runs : DataFrame
        As from :func:`fuse_flights`.
    windows : dict, optional
        Masks by name, as :data:`WINDOWS`.

    Returns
    -------
    DataFrame
        Columns flight, fibre_number, window, estimate, mean_mm, rmse_mm, max_mm and percent_of_step (the
        mean of error over step, as the paper's lower plots).
    """
    rows = []
    for (flight, number), run in runs.groupby(["flight", "fibre_number"]):
        for window, chosen in windows.items():
            part = run[chosen(run)]
            for estimate in ESTIMATES:
                error = part[f"{estimate}_mm"]
                percent = 100 * (error / part["step_mm"].where(part["step_mm"] > 0)).mean()
                statistics = error.mean(), np.sqrt((error**2).mean()), error.max(), percent
                rows.append((flight, number, window, estimate, *statistics))
    keys = ["flight", "fibre_number", "window", "estimate"]
    return pd.DataFrame(rows, columns=[*keys, "mean_mm", "rmse_mm", "max_mm", "percent_of_step"])


def fusion_table(errors: pd.DataFrame, statistic: str = "mean_mm") -> pd.DataFrame:
    """Return one statistic of :func:`window_errors`: "mean [2.5 %, 97.5 %]" over fibres, by estimate."""
    grouped = errors.groupby(["flight", "window", "estimate"], sort=False)[statistic]
    middle, low, high = grouped.mean(), grouped.quantile(0.025), grouped.quantile(0.975)
    text = [
        f"{value:.2f}" if top - bottom < 0.005 else f"{value:.2f} [{bottom:.2f}, {top:.2f}]"
        for value, bottom, top in zip(middle, low, high)
    ]
    table = pd.Series(text, index=middle.index).unstack("estimate", sort=False)
    return table[list(ESTIMATES)].reset_index()


def coverage(runs: pd.DataFrame) -> pd.DataFrame:
    """Return how often the truth lies in the filter's ellipsoid of 95 %, per flight.

    Once with the filter's own covariance, which takes the drift of the map for white noise, and once with the
    variance of that drift, :data:`CAMERA_BIAS`, added back.
    """
    columns = {"filter_distance": "own_covariance", "filter_drift_distance": "with_drift"}
    inside = runs[list(columns)].rename(columns=columns) < chi2.ppf(0.95, 3)
    return inside.groupby(runs["flight"], sort=False).mean().reset_index()


def error_against_confidence(name: str) -> pd.DataFrame:
    """Return how well the camera's own signs of trouble follow its error; tracked frames only.

    Parameters
    ----------
    name : str
        Flight.

    Returns
    -------
    DataFrame
        Columns sign, rank_correlation (Spearman's, with the error) and finds_worst: the probability that the
        sign is larger in one of the worst hundredth of the frames than in another one; 0.5 is chance.
    """
    tracked = load_flight(name).query("tracked > 0")
    error = pd.Series(np.linalg.norm(camera_errors(tracked), axis=1), tracked.index)
    mean_error, inliers = tracked["match_error_px"], tracked["inliers"]
    signs = {
        "mean error of the inliers (printed e_S)": tracked["inlier_error_px"],
        "mean error of all matches": mean_error,
        "inlier-weighted error": pose_fusion.inlier_weighted_error(mean_error, inliers),
        "fewer inliers": -inliers,
        "spread by the Jacobian": tracked["spread_mm"],
    }
    table = pd.DataFrame(signs)
    worst = error >= error.quantile(0.99)
    larger = mannwhitneyu(table[worst], table[~worst]).statistic / (worst.sum() * (~worst).sum())
    correlation = table.corrwith(error, method="spearman")
    return correlation.rename_axis("sign").reset_index(name="rank_correlation").assign(finds_worst=larger)
