"""How well the cameras know arm and ball, and what their errors come from.

Poses are drawn at random where handovers happen; images are rendered and detected; the truth is known. The
tables are tidy, errors in mm and degrees in the frame `arm_base` (y is the cameras' depth).
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from soro_lib.papers.soft_handover.world.observer import calibrate_on_box
from soro_lib.papers.soft_handover.world.scene import (
    SIDE_CAMERA,
    STEREO,
    WEBCAM,
    HandoverScene,
    Viewpoint,
    photograph,
)
from soro_lib.project import data_directory
from soro_lib.replication.datacards import verified
from soro_lib.replication.findings import Finding
from soro_lib.robots.helix import HelixArm
from soro_lib.sensing.handover_observation import HandoverObservation
from soro_lib.sensing.handover_vision import ESTIMATORS, HandoverVision, Look
from soro_lib.sensing.marker_pose import WristPose, average_pose, wrist_candidates
from soro_lib.sensing.stereo_vision import CORNER_SHIFT, CalibratedCamera
from soro_lib.worlds.rendering import Photometry

SEED = 7
"""Seed of the recordings."""

Report = Callable[[int], None]
"""Told how many more pictures have been looked at."""

HIDDEN = 0.85
"""Visible share below which a ball counts as partly hidden."""

LARGEST_TILT = np.deg2rad(35.0)
LARGEST_OFFSET = 0.22
HEIGHTS = (0.52, 0.74)
"""Largest tilt [rad], largest distance from the hanging arm and range of depth [m] of random grippers."""


def recorded(name: str) -> pd.DataFrame:
    """Return a recording of :mod:`soro_lib.papers.soft_handover.recordings`, checked against its card."""
    return pd.read_csv(verified(data_directory("soft_handover") / f"{name}.csv.gz"))


def nothing(pictures: int) -> None:
    """Report to nobody."""


def random_states(count: int, rng: np.random.Generator, arm: HelixArm | None = None) -> NDArray[np.float64]:
    """Return true states (count, 9) that put the gripper where handovers happen."""
    arm = arm or HelixArm()
    kept: list[NDArray[np.float64]] = []
    while len(kept) < count:
        states = np.tile(arm.home.reshape(3, 3), (200, 1, 1))
        states[:, :, :2] += rng.normal(0.0, [[0.2], [0.4], [0.4]], (200, 3, 2))
        states[:, :, 2] -= rng.uniform(0.0, [0.02, 0.05, 0.05], (200, 3))
        states = states.reshape(200, 9)
        points = arm.tip_points(states)
        tilt = np.arccos(np.clip((points[:, 5] - points[:, 2]) / arm.gripper_length, -1, 1))
        inside = (tilt < LARGEST_TILT) & (np.hypot(points[:, 3], points[:, 4]) < LARGEST_OFFSET)
        inside &= (points[:, 5] > HEIGHTS[0]) & (points[:, 5] < HEIGHTS[1])
        kept += list(states[inside])
    return np.array(kept[:count])


def ball_before(gripper: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
    """Return a ball (3,) [m] below and beside the gripper point, as during an approach."""
    return gripper + rng.uniform([-0.08, -0.08, 0.05], [0.08, 0.08, 0.12])


@dataclass(frozen=True)
class Condition:
    """One cause of error, or several, switched on or off.

    Attributes
    ----------
    name : str
    views : sequence of Viewpoint
        The cameras.
    selection_deviation : float
        With which the corners of the calibration box are selected [px].
    photometry : Photometry
    corner_shift : float
        Correction of the markers' corners [px].
    flips_known : bool
        Whether of the two poses of every marker the one nearer to the truth is taken, as no detector could.
    """

    name: str
    views: Sequence[Viewpoint] = STEREO
    selection_deviation: float = 0.5
    photometry: Photometry = WEBCAM
    corner_shift: float = CORNER_SHIFT
    flips_known: bool = False


NO_SENSOR_NOISE = Photometry(read_noise=0.0, shot_noise=0.0, blur=WEBCAM.blur)

CAUSES = (
    Condition("all causes"),
    Condition("corners as detected", corner_shift=0.0),
    Condition("exact calibration", selection_deviation=0.0),
    Condition("exact calibration, no flips", selection_deviation=0.0, flips_known=True),
    Condition("exact calibration, no sensor noise", selection_deviation=0.0, photometry=NO_SENSOR_NOISE),
    Condition("three cameras", views=(*STEREO, SIDE_CAMERA)),
)
"""The conditions of the error budget."""


def accuracy(
    count: int, seed: int, conditions: Sequence[Condition] = CAUSES, report: Report = nothing
) -> pd.DataFrame:
    """Return the errors of every estimator at random poses under every condition.

    All conditions see the same poses, and are calibrated with the same selection errors scaled.

    Parameters
    ----------
    count : int
        Number of poses.
    seed : int
    conditions : sequence of Condition
    report : callable

    Returns
    -------
    DataFrame
        condition, estimator, pose, markers, flipped (share of markers whose better solution is the wrong
        one), wrist_{x,y,z}_mm, wrist_mm, direction_{x,y,z}, direction_deg, claimed_mm, gripper_mm,
        ball_{x,y,z}_mm, ball_mm, gap_mm.
    """
    scene = HandoverScene()
    rows = []
    for pose, sequence in enumerate(np.random.SeedSequence(seed).spawn(count)):
        rng = np.random.default_rng(sequence)
        state = random_states(1, rng)[0]
        ball = ball_before(scene.arm.tip_points(state)[3:], rng)
        picture_seed, selection_seed = sequence.spawn(2)
        for condition in conditions:
            cameras = calibrate_on_box(
                condition.views, np.random.default_rng(selection_seed), condition.selection_deviation
            )
            pictures = np.random.default_rng(picture_seed)
            for estimator, look, wrist, flipped in _estimates(
                scene, state, ball, condition, cameras, pictures
            ):
                errors = _errors(scene, state, ball, look.observation, wrist)
                seen = sum(map(len, look.markers))
                rows.append(
                    {
                        "condition": condition.name,
                        "estimator": estimator,
                        "pose": pose,
                        "markers": seen,
                        "flipped": flipped,
                        **errors,
                    }
                )
        report(1)
    return pd.DataFrame(rows)


def _estimates(
    scene: HandoverScene,
    state: NDArray[np.float64],
    ball: NDArray[np.float64],
    condition: Condition,
    cameras: Sequence[CalibratedCamera],
    rng: np.random.Generator,
) -> Iterator[tuple[str, Look, WristPose | None, float]]:
    """Yield for each estimator its name, the look, its wrist and the share of flipped markers.

    All are made of one look, so the ball is the same: nothing hides it here.
    """
    items = scene.items(state, ball)
    pictures = [photograph(items, view, condition.photometry, rng) for view in condition.views]
    vision = HandoverVision(cameras, "joint", track=False, corner_shift=condition.corner_shift)
    look = vision.look(pictures)
    candidates, flips = true_candidates(look, cameras, scene, state)
    flipped = float(flips.mean()) if len(flips) else np.nan
    for estimator in ("thesis",) if condition.flips_known else ESTIMATORS:
        if condition.flips_known and len(candidates):
            wrist: WristPose | None = average_pose(candidates)
        else:
            wrist = vision.estimate(look.markers, estimator)
        yield estimator, look, wrist, flipped


def true_candidates(
    look: Look, cameras: Sequence[CalibratedCamera], scene: HandoverScene, state: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return the poses of all markers, the one nearer to the truth first (m, 2, 4, 4), and which of them
    OpenCV had second (m,)."""
    sights = [wrist_candidates(m, c, scene.ring) for c, m in zip(cameras, look.markers) if m]
    if not sights:
        return np.empty((0, 2, 4, 4)), np.empty(0, dtype=bool)
    candidates = np.concatenate(sights)
    truth = scene.wrist(state)[:3, 2]
    agreement = candidates[..., :3, 2] @ truth
    flipped = agreement[:, 1] > agreement[:, 0]
    candidates[flipped] = candidates[flipped][:, ::-1]
    return candidates, flipped


def _errors(
    scene: HandoverScene,
    state: NDArray[np.float64],
    ball: NDArray[np.float64],
    seen: HandoverObservation,
    wrist: WristPose | None,
) -> dict[str, float]:
    """Return all errors of one look against the truth."""
    missing = np.full(3, np.nan)
    points = scene.arm.tip_points(state)
    axis = (points[3:] - points[:3]) / scene.arm.gripper_length
    wrist_error = missing if wrist is None else 1e3 * (wrist.wrist - points[:3])
    pointing = missing if wrist is None else wrist.direction
    gripper_error = wrist_error + 1e3 * scene.arm.gripper_length * (pointing - axis)
    ball_error = missing if seen.ball is None else 1e3 * (seen.ball - ball)
    return {
        **{f"wrist_{name}_mm": value for name, value in zip("xyz", wrist_error)},
        "wrist_mm": float(np.linalg.norm(wrist_error)),
        **{f"direction_{name}": value for name, value in zip("xyz", pointing - axis)},
        "direction_deg": float(np.rad2deg(2 * np.arcsin(np.linalg.norm(pointing - axis) / 2))),
        "claimed_mm": np.nan if wrist is None else 1e3 * wrist.wrist_deviation,
        "gripper_mm": float(np.linalg.norm(gripper_error)),
        **{f"ball_{name}_mm": value for name, value in zip("xyz", ball_error)},
        "ball_mm": float(np.linalg.norm(ball_error)),
        "gap_mm": np.nan if seen.ball is None else 1e3 * seen.disagreement,
    }


def error_budget(table: pd.DataFrame) -> pd.DataFrame:
    """Return median and 95th percentile of the errors per condition and estimator, and their mean (bias)."""
    groups = table.groupby(["condition", "estimator"], sort=False)
    budget = pd.DataFrame({"markers": groups["markers"].mean()})
    for name in ("wrist_mm", "direction_deg", "gripper_mm", "ball_mm"):
        what, unit = name.rsplit("_", 1)
        budget[f"{what}_median_{unit}"] = groups[name].median()
        budget[f"{what}_p95_{unit}"] = groups[name].quantile(0.95)
    budget["depth_bias_mm"] = groups["wrist_y_mm"].mean()
    budget["flipped"] = groups["flipped"].mean()
    return budget.reset_index()


@dataclass(frozen=True)
class NoiseSources:
    """Repeated looks at still arms: what changes from look to look, and what stays.

    Attributes
    ----------
    poses, looks : int
        Still arms, and looks at each.
    """

    poses: int = 40
    looks: int = 8


def still_looks(sources: NoiseSources, seed: int, report: Report = nothing) -> pd.DataFrame:
    """Return the errors of repeated looks at still arms, each pose with its own calibration.

    Returns
    -------
    DataFrame
        camera_system ("thesis", "gated", "joint", "three cameras"), pose, look, and the errors of
        :func:`accuracy`.
    """
    scene = HandoverScene()
    views = (*STEREO, SIDE_CAMERA)
    rows = []
    for pose, sequence in enumerate(np.random.SeedSequence(seed).spawn(sources.poses)):
        rng = np.random.default_rng(sequence)
        state = random_states(1, rng)[0]
        ball = ball_before(scene.arm.tip_points(state)[3:], rng)
        cameras = calibrate_on_box(views, rng)
        systems = {name: HandoverVision(cameras[:2], name, track=False) for name in ESTIMATORS}
        systems["three cameras"] = HandoverVision(cameras, "joint", track=False)
        items = scene.items(state, ball)
        for number in range(sources.looks):
            pictures = [photograph(items, view, WEBCAM, rng) for view in views]
            for name, vision in systems.items():
                vision.reset()
                look = vision.look(pictures[: len(vision.cameras)])
                wrist = vision.estimate(look.markers, vision.estimator)
                errors = _errors(scene, state, ball, look.observation, wrist)
                rows.append({"camera_system": name, "pose": pose, "look": number, **errors})
        report(1)
    return pd.DataFrame(rows)


def noise_figures(still: pd.DataFrame, hidden: pd.DataFrame) -> dict[str, dict[str, float]]:
    """Return the figures of :class:`soro_lib.sensing.handover_observation.VisionNoise` per camera system.

    Jitter is the deviation of the looks at one pose around their mean, bias the deviation of these means from
    the truth, both root mean squares over poses and components.

    Parameters
    ----------
    still : DataFrame
        Of :func:`still_looks`.
    hidden : DataFrame
        Of :func:`soro_lib.papers.soft_handover.experiments.vision_limits.occlusion`.
    """
    figures: dict[str, dict[str, float]] = {}
    for name, looks in still.groupby("camera_system", sort=False):
        figures[str(name)] = {}
        for what, columns, unit in (
            ("wrist", [f"wrist_{axis}_mm" for axis in "xyz"], 1e-3),
            ("direction", [f"direction_{axis}" for axis in "xyz"], 1.0),
            ("ball", [f"ball_{axis}_mm" for axis in "xyz"], 1e-3),
        ):
            groups = looks.groupby("pose")[columns]
            jitter = float(np.sqrt(np.nanmean(groups.var())))
            bias = float(np.sqrt(np.nanmean(groups.mean() ** 2)))
            figures[str(name)] |= {f"{what}_jitter": unit * jitter, f"{what}_bias": unit * bias}
        rule = "largest piece" if name == "thesis" else "joined pieces"
        covered = hidden[(hidden["rule"] == rule) & (hidden["visible"] < HIDDEN)]
        errors = covered[[f"ball_{axis}_mm" for axis in "xyz"]].to_numpy()
        figures[str(name)]["occluded_ball"] = 1e-3 * float(np.sqrt(np.nanmean(errors**2)))
    return figures


BLOCK = 20
"""Poses that share one vote on a claim."""


def vision_findings(
    accuracy_table: pd.DataFrame, hidden: pd.DataFrame, places: pd.DataFrame
) -> dict[str, Finding]:
    """Return the findings of the vision study, keyed by the id of the published row.

    Parameters
    ----------
    accuracy_table : DataFrame
        Of :func:`accuracy`.
    hidden : DataFrame
        Of :func:`soro_lib.papers.soft_handover.experiments.vision_limits.occlusion`.
    places : DataFrame
        Of :func:`soro_lib.papers.soft_handover.experiments.vision_limits.workspace_limits`.
    """
    left, right = (view.pose[:3, 3] for view in STEREO)
    ball = accuracy_table[accuracy_table["estimator"] == "joint"].pivot(
        index="pose", columns="condition", values="ball_mm"
    )
    by_block = ball.groupby(ball.index // BLOCK).median()
    largest = hidden[hidden["rule"] == "largest piece"]
    errors = largest.assign(hidden=largest["visible"] < HIDDEN, block=largest["pose"] // BLOCK)
    medians = errors.pivot_table(index="block", columns="hidden", values="ball_mm", aggfunc="median").dropna()
    worst = {bool(key): group.quantile(0.95) for key, group in errors.groupby("hidden")["ball_mm"]}
    default = places[(places["field_of_view"] == "78 deg") & (places["limit"] != "")]
    parallel = default[default["cameras"] != "aimed at the arm"]
    return {
        "s32_baseline": Finding(float(np.linalg.norm(left - right))),
        "s324_marker_size": Finding(1e3 * HandoverScene().ring.marker),
        "s54_third_camera_better": Finding(
            (by_block["three cameras"] < by_block["all causes"]).astype(float),
            f"median {ball['all causes'].median():.2f} mm with two cameras, "
            f"{ball['three cameras'].median():.2f} mm with a third from the side, in blocks of {BLOCK} poses",
        ),
        "fig15_occlusion_hurts": Finding(
            (medians[True] > medians[False]).astype(float),
            f"95th percentile {worst[True]:.1f} mm hidden, {worst[False]:.1f} mm not hidden",
        ),
        "fig14_side_limits": Finding(
            (parallel["limit"] == "right").astype(float),
            "for parallel and half toed-in cameras; cameras aimed at the arm reverse it",
        ),
    }
