"""How well the cameras know arm and ball, and what their errors come from.

Poses are drawn at random where handovers happen; images are rendered and detected; the truth is known. The
tables are tidy, errors in mm and degrees in the frame `arm_base` (y is the cameras' depth).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.random import Generator
from numpy.typing import NDArray

from soro_lib.papers.soft_handover.world.observer import calibrate_on_box
from soro_lib.papers.soft_handover.world.plant import Array
from soro_lib.papers.soft_handover.world.scene import SIDE_CAMERA, STEREO, WEBCAM, HandoverScene, photographs
from soro_lib.project import data_directory
from soro_lib.replication.datacards import verified
from soro_lib.sensing.handover_observation import HandoverObservation
from soro_lib.sensing.handover_vision import ESTIMATORS, HandoverVision, Look
from soro_lib.sensing.marker_pose import WristPose, average_pose, wrist_candidates
from soro_lib.sensing.stereo_vision import CORNER_SHIFT, CalibratedCamera
from soro_lib.worlds.rendering import Photometry

SCENE = HandoverScene()
"""The arm, the ring and the ball of all pictures."""

SEED = 7
"""Seed of the recordings."""

HIDDEN = 0.85
"""Visible share below which a ball counts as partly hidden."""

LARGEST_TILT = np.deg2rad(35.0)
LARGEST_OFFSET = 0.22
HEIGHTS = (0.52, 0.74)
"""Largest tilt [rad], largest distance from the hanging arm and range of depth [m] of random grippers."""


def recorded(name: str) -> pd.DataFrame:
    """Return a recording of :mod:`soro_lib.papers.soft_handover.recordings`, checked against its card."""
    return pd.read_csv(verified(data_directory("soft_handover") / f"{name}.csv.gz"))


def random_states(count: int, rng: Generator) -> Array:
    """Return true states (count, 9) that put the gripper where handovers happen."""
    arm = SCENE.arm
    kept: list[Array] = []
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


def ball_before(gripper: Array, rng: Generator) -> Array:
    """Return a ball (3,) [m] below and beside the gripper point, as during an approach."""
    return gripper + rng.uniform([-0.08, -0.08, 0.05], [0.08, 0.08, 0.12])


def approach(rng: Generator) -> tuple[Array, Array]:
    """Return a random true state (9,) and a ball (3,) [m] before its gripper."""
    state = random_states(1, rng)[0]
    return state, ball_before(SCENE.arm.tip_points(state)[3:], rng)


def poses(count: int, seed: int) -> Iterator[tuple[int, Generator]]:
    """Yield the number of each random pose and its random numbers, the same however many poses follow."""
    return enumerate(map(np.random.default_rng, np.random.SeedSequence(seed).spawn(count)))


@dataclass(frozen=True)
class Condition:
    """One cause of error, or several, switched on or off.

    Attributes
    ----------
    name : str
    views : sequence of CalibratedCamera
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
    views: Sequence[CalibratedCamera] = STEREO
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


def accuracy(count: int, seed: int, conditions: Sequence[Condition] = CAUSES) -> pd.DataFrame:
    """Return the errors of every estimator at random poses under every condition.

    All conditions see the same poses, and are calibrated with the same selection errors scaled.

    Parameters
    ----------
    count : int
        Number of poses.
    seed : int
    conditions : sequence of Condition

    Returns
    -------
    DataFrame
        condition, estimator, pose, markers, flipped (share of markers whose better solution is the wrong
        one), wrist_{x,y,z}_mm, wrist_mm, direction_{x,y,z}, direction_deg, claimed_mm, gripper_mm,
        ball_{x,y,z}_mm, ball_mm, gap_mm.
    """
    rows = []
    for pose, rng in poses(count, seed):
        state, ball = approach(rng)
        items = SCENE.items(state, ball)
        picture_seed, selection_seed = rng.bit_generator.seed_seq.spawn(2)  # type: ignore[attr-defined]
        for condition in conditions:
            selection = np.random.default_rng(selection_seed)
            cameras = calibrate_on_box(condition.views, selection, condition.selection_deviation)
            noise = np.random.default_rng(picture_seed)
            pictures = photographs(items, condition.views, condition.photometry, noise)
            # One look for all estimators, so that the ball is the same: nothing hides it here.
            vision = HandoverVision(cameras, "joint", track=False, corner_shift=condition.corner_shift)
            look = vision.look(pictures)
            candidates, flips = true_candidates(look, cameras, state)
            flipped = float(flips.mean()) if len(flips) else np.nan
            seen = {"pose": pose, "markers": sum(map(len, look.markers)), "flipped": flipped}
            for estimator in ("thesis",) if condition.flips_known else ESTIMATORS:
                wrist = vision.estimate(look.markers, estimator)
                if condition.flips_known and len(candidates):
                    wrist = average_pose(candidates)
                errors = look_errors(state, ball, look.observation, wrist)
                rows.append({"condition": condition.name, "estimator": estimator, **seen, **errors})
    return pd.DataFrame(rows)


def true_candidates(
    look: Look, cameras: Sequence[CalibratedCamera], state: Array
) -> tuple[Array, NDArray[np.bool_]]:
    """Return the poses of all markers, the one nearer to the truth first (m, 2, 4, 4), and which of them
    OpenCV had second (m,)."""
    sights = [wrist_candidates(m, c, SCENE.ring) for c, m in zip(cameras, look.markers) if m]
    candidates = np.concatenate([np.empty((0, 2, 4, 4)), *sights])
    agreement = candidates[..., :3, 2] @ SCENE.wrist(state)[:3, 2]
    flipped = agreement[:, 1] > agreement[:, 0]
    candidates[flipped] = candidates[flipped][:, ::-1]
    return candidates, flipped


def look_errors(
    state: Array, ball: Array, seen: HandoverObservation, wrist: WristPose | HandoverObservation | None
) -> dict[str, float]:
    """Return all errors of one look against the truth, NaN where nothing was seen."""
    missing = np.full(3, np.nan)
    points = SCENE.arm.tip_points(state)
    axis = (points[3:] - points[:3]) / SCENE.arm.gripper_length
    wrist_error, turn, claimed = missing, missing, np.nan
    if wrist is not None and wrist.wrist is not None and wrist.direction is not None:
        wrist_error, turn = 1e3 * (wrist.wrist - points[:3]), wrist.direction - axis
        claimed = 1e3 * wrist.wrist_deviation
    gripper_error = wrist_error + 1e3 * SCENE.arm.gripper_length * turn
    ball_error = missing if seen.ball is None else 1e3 * (seen.ball - ball)
    return {
        **{f"wrist_{name}_mm": value for name, value in zip("xyz", wrist_error)},
        "wrist_mm": float(np.linalg.norm(wrist_error)),
        **{f"direction_{name}": value for name, value in zip("xyz", turn)},
        "direction_deg": float(np.rad2deg(2 * np.arcsin(np.linalg.norm(turn) / 2))),
        "claimed_mm": claimed,
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


def still_looks(count: int, seed: int, looks: int = 8) -> pd.DataFrame:
    """Return the errors of repeated looks at still arms, each pose with its own calibration.

    What changes from look to look is jitter, what stays is bias.

    Returns
    -------
    DataFrame
        camera_system ("thesis", "gated", "joint", "three cameras"), pose, look, and the errors of
        :func:`accuracy`.
    """
    views = (*STEREO, SIDE_CAMERA)
    rows = []
    for pose, rng in poses(count, seed):
        state, ball = approach(rng)
        cameras = calibrate_on_box(views, rng)
        systems = {name: HandoverVision(cameras[:2], name, track=False) for name in ESTIMATORS}
        systems["three cameras"] = HandoverVision(cameras, "joint", track=False)
        items = SCENE.items(state, ball)
        for number in range(looks):
            pictures = photographs(items, views, WEBCAM, rng)
            for name, vision in systems.items():
                vision.reset()
                look = vision.look(pictures[: len(vision.cameras)])
                wrist = vision.estimate(look.markers, vision.estimator)
                errors = look_errors(state, ball, look.observation, wrist)
                rows.append({"camera_system": name, "pose": pose, "look": number, **errors})
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
    columns = {
        "wrist": ([f"wrist_{axis}_mm" for axis in "xyz"], 1e-3),
        "direction": ([f"direction_{axis}" for axis in "xyz"], 1.0),
        "ball": ([f"ball_{axis}_mm" for axis in "xyz"], 1e-3),
    }
    figures: dict[str, dict[str, float]] = {}
    for name, looks in still.groupby("camera_system", sort=False):
        budget = figures[str(name)] = {}
        for what, (errors, unit) in columns.items():
            groups = looks.groupby("pose")[errors]
            budget[f"{what}_jitter"] = unit * float(np.sqrt(np.nanmean(groups.var())))
            budget[f"{what}_bias"] = unit * float(np.sqrt(np.nanmean(groups.mean() ** 2)))
        rule = "largest piece" if name == "thesis" else "joined pieces"
        covered = hidden[(hidden["rule"] == rule) & (hidden["visible"] < HIDDEN)]
        balls = covered[columns["ball"][0]].to_numpy()
        budget["occluded_ball"] = 1e-3 * float(np.sqrt(np.nanmean(balls**2)))
    return figures
