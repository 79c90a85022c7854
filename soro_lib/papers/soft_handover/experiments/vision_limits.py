"""Where the cameras of the handover fail: hidden balls (Vervloet, Fig. 15), the edge of the picture (Fig.
14), blur, darkness and noise, and faults of the images themselves.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.random import Generator
from numpy.typing import NDArray

from soro_lib.papers.soft_handover.experiments import vision
from soro_lib.papers.soft_handover.experiments.vision import SCENE
from soro_lib.papers.soft_handover.world import scene
from soro_lib.papers.soft_handover.world.observer import calibrate_on_box
from soro_lib.papers.soft_handover.world.plant import Array
from soro_lib.papers.soft_handover.world.scene import STEREO, WEBCAM, Extras, photographs
from soro_lib.sensing.camera import Image, invert_pose, transform_points
from soro_lib.sensing.handover_vision import ESTIMATORS, HandoverVision
from soro_lib.sensing.stereo_vision import CalibratedCamera

BALL_RULES = {"largest piece": "thesis", "joined pieces": "joint"}
"""How a hidden ball is measured, and the estimator that does it so."""


def occlusion(count: int, seed: int) -> pd.DataFrame:
    """Return how well a ball between the fingers is located, against how much of it can be seen (Fig. 15).

    Half of the balls lie between the open fingers (10 mm per axis off the gripper point), half farther below.

    Returns
    -------
    DataFrame
        pose, rule, visible (the smaller share of the two cameras), ball_{x,y,z}_mm, ball_mm, gap_mm,
        claimed_mm.
    """
    rows = []
    for pose in range(count):
        case = hidden_ball(pose, seed)
        for rule, estimator in BALL_RULES.items():
            seen = HandoverVision(case.cameras, estimator, track=False).look(case.pictures).observation
            errors = vision.look_errors(case.state, case.ball, seen, None)
            ball = {name: errors[name] for name in ("ball_x_mm", "ball_y_mm", "ball_z_mm", "ball_mm")}
            claims = {"gap_mm": 1e3 * seen.disagreement, "claimed_mm": 1e3 * seen.ball_deviation}
            rows.append({"pose": pose, "rule": rule, "visible": case.visible, **ball, **claims})
    return pd.DataFrame(rows)


class HiddenBall(NamedTuple):
    """A ball that the gripper may hide in part.

    Attributes
    ----------
    state, ball : ndarray, shape (9,) and (3,)
        The true arm, and the true place of the ball [m].
    cameras : list of CalibratedCamera
    pictures : list of images
    visible : float
        Visible share, the smaller of the cameras.
    """

    state: Array
    ball: Array
    cameras: list[CalibratedCamera]
    pictures: list[Image]
    visible: float


def hidden_ball(pose: int, seed: int) -> HiddenBall:
    """Return one of the balls of :func:`occlusion`; every odd one lies between the fingers."""
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(pose,)))
    state = vision.random_states(1, rng)[0]
    gripper = SCENE.arm.tip_points(state)[3:]
    ball = gripper + 0.010 * rng.standard_normal(3) if pose % 2 else vision.ball_before(gripper, rng)
    cameras = calibrate_on_box(STEREO, rng)
    pictures = photographs(SCENE.items(state, ball), STEREO, WEBCAM, rng)
    visible = min(visible_share(state, ball, view) for view in STEREO)
    return HiddenBall(state, ball, cameras, pictures, visible)


def visible_share(state: Array, ball: Array, view: CalibratedCamera) -> float:
    """Return the share of the ball's pixels that a camera sees, counted in pictures with and without the
    rest."""
    still, clean = np.random.default_rng(0), replace(vision.NO_SENSOR_NOISE, blur=0.0)
    empty, alone, together = (
        scene.photograph(items, view, clean, still).astype(int)
        for items in ([], [SCENE.ball(ball)], SCENE.items(state, ball))
    )
    of_ball = np.abs(alone - empty).max(axis=-1) > 0
    kept = np.abs(alone - together).max(axis=-1)[of_ball] <= 2
    return float(kept.mean()) if kept.size else 0.0


FIELDS_OF_VIEW = {"90 deg": 734.0, "78 deg": 907.0, "65 deg": 1153.0}
"""Focal lengths [px] of the three fields of view that the Logitech Brio offers."""

TOE_IN = {"parallel": 0.0, "half toed in": 0.5, "aimed at the arm": 1.0}
"""How the cameras are turned toward each other."""


def workspace(
    toe_in: float = 0.5, focal_length: float = scene.BRIO.focal_length, step: float = 0.02
) -> pd.DataFrame:
    """Return which cameras see ring and ball, for every place of the gripper on a grid (Fig. 14).

    A camera sees a place if the ball's outline under the upright gripper and the top of the marker ring, with
    30 mm to both sides, lie in its picture.

    Returns
    -------
    DataFrame
        x_mm, y_mm, z_mm (gripper point in `arm_base`), left, right (whether each camera sees it).
    """
    camera = replace(scene.BRIO, focal_length=focal_length)
    axes = np.arange(-0.80, 0.801, step), (-0.2, 0.0, 0.2), np.arange(0.30, 1.001, step)
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    sides = [(x, 0.0, z) for x in (-0.03, 0.03) for z in (-0.115, 0.02)]
    columns = {f"{axis}_mm": 1e3 * values for axis, values in zip("xyz", grid.T)}
    for name, view in zip(("left", "right"), scene.stereo_pair(toe_in=toe_in, camera=camera)):
        columns[name] = np.logical_and.reduce([in_picture(view, grid + side) for side in sides])
    return pd.DataFrame(columns)


def in_picture(view: CalibratedCamera, points: Array) -> NDArray[np.bool_]:
    """Return for every point (n, 3) [m] whether it lies in a camera's picture."""
    seen = transform_points(invert_pose(view.pose), points)
    ahead = (seen[:, 2] > 0.1) & (np.hypot(*seen[:, :2].T) < view.camera.reach * seen[:, 2])
    pixels = view.camera.project(np.where(ahead[:, None], seen, [0.0, 0.0, 1.0]))
    inside = (pixels >= 0) & (pixels <= (view.camera.width - 1, view.camera.height - 1))
    return np.asarray(ahead & inside.all(axis=1))


def workspace_limits(step: float = 0.02) -> pd.DataFrame:
    """Return for all fields of view and ways of aiming how far to the side the gripper is seen by both.

    The height is that of the calibrated gripper. ``limit`` names the camera that loses sight first on the
    left side.
    """
    rows = []
    for (angle, focal_length), (aim, toe_in) in product(FIELDS_OF_VIEW.items(), TOE_IN.items()):
        table = workspace(toe_in, focal_length, step)
        for depth, near in table.groupby("y_mm"):
            level = near[np.isclose(near["z_mm"], 700.0, atol=1e3 * step / 2 - 1e-6)]
            reach = level.loc[level["left"] & level["right"], "x_mm"]
            sides = {"left_mm": reach.min(), "right_mm": reach.max(), "limit": limiting_camera(level)}
            area = (near["left"] & near["right"]).sum() * step**2
            view = {"field_of_view": angle, "cameras": aim, "toward_cameras_mm": depth}
            rows.append({**view, **sides, "area_m2": area})
    return pd.DataFrame(rows)


def limiting_camera(level: pd.DataFrame) -> str:
    """Return which camera does not see the place just left of what both see: "left", "right" or "both"."""
    places = level.sort_values("x_mm").reset_index(drop=True)
    seen = places.index[places["left"] & places["right"]]
    if not len(seen) or seen[0] == 0:
        return ""
    outside = places.loc[seen[0] - 1]
    lost = [name for name in ("left", "right") if not outside[name]]
    return "both" if len(lost) == 2 else lost[0]


DEGRADATIONS = {
    "none": WEBCAM,
    "blur 1.0 px": replace(WEBCAM, blur=1.0),
    "blur 1.5 px": replace(WEBCAM, blur=1.5),
    "blur 2.0 px": replace(WEBCAM, blur=2.0),
    "motion 5 px": replace(WEBCAM, motion=(5.0, 0.0)),
    "motion 9 px": replace(WEBCAM, motion=(9.0, 0.0)),
    "light x 1.4": replace(WEBCAM, gain=1.4),
    "light x 0.5": replace(WEBCAM, gain=0.5),
    "light x 0.25": replace(WEBCAM, gain=0.25),
    "light x 0.15": replace(WEBCAM, gain=0.15),
    "noise 6": replace(WEBCAM, read_noise=6.0),
    "noise 12": replace(WEBCAM, read_noise=12.0),
}
"""Pictures worse than ordinary: blur of lens and movement, light, noise [grey levels]."""


def degradations(count: int, seed: int) -> pd.DataFrame:
    """Return how well arm and ball are located in bad pictures, the same poses in all.

    Returns
    -------
    DataFrame
        degradation, estimator, pose, markers, gripper_mm, ball_mm (NaN where not found).
    """
    rows = []
    for pose, rng in vision.poses(count, seed):
        state, ball = vision.approach(rng)
        cameras = calibrate_on_box(STEREO, rng)
        items = SCENE.items(state, ball)
        for name, photometry in DEGRADATIONS.items():
            pictures = photographs(items, STEREO, photometry, rng)
            for estimator in ESTIMATORS:
                look = HandoverVision(cameras, estimator, track=False).look(pictures)
                row = {"degradation": name, "estimator": estimator, "pose": pose}
                errors = vision.look_errors(state, ball, look.observation, look.observation)
                row |= {"markers": sum(map(len, look.markers))}
                rows.append(row | {what: errors[what] for what in ("gripper_mm", "ball_mm")})
    return pd.DataFrame(rows)


@dataclass(frozen=True)
class ImageFault:
    """Something wrong with what the detector is given.

    Attributes
    ----------
    name : str
    extras : Extras
        What is in the pictures.
    spoil : callable, optional
        From pictures and those of an earlier moment to what arrives.
    """

    name: str
    extras: Extras = field(default_factory=Extras)
    spoil: Callable[[list[Image], list[Image]], Sequence[Image | None]] = lambda now, before: now


IMAGE_FAULTS = (
    ImageFault("none"),
    ImageFault("half of the ring hidden", Extras(hidden_markers=frozenset(range(0, 10, 2)))),
    ImageFault("ring hidden", Extras(hidden_markers=frozenset(range(10)))),
    ImageFault("second green ball, nearer", Extras(second_ball=(0.22, 0.20, 0.62))),
    ImageFault("cameras swapped", spoil=lambda now, before: now[::-1]),
    ImageFault("one camera covered", spoil=lambda now, before: [np.full_like(now[0], 8), now[1]]),
    ImageFault("one camera frozen", spoil=lambda now, before: [before[0], now[1]]),
    ImageFault("no picture from one camera", spoil=lambda now, before: [None, now[1]]),
    ImageFault("not a number", spoil=lambda now, before: [np.full(now[0].shape, np.nan), now[1]]),
)
"""Faults of the pictures; those of the observation are in
:mod:`soro_lib.papers.soft_handover.experiments.faults`."""

LOCATED = 15.0
"""Largest error of a gripper or ball that counts as located [mm]."""


def image_faults(count: int, seed: int) -> pd.DataFrame:
    """Return what becomes of arm and ball under every fault, in the second of two looks 30 mm apart.

    Returns
    -------
    DataFrame
        fault, estimator, pose, gripper, ball ("located" within 15 mm, "refused", "wrong"), status.
    """
    rows = []
    for pose, rng in vision.poses(count, seed):
        before, now = moved_apart(rng)
        ball = vision.ball_before(SCENE.arm.tip_points(now)[3:], rng)
        cameras = calibrate_on_box(STEREO, rng)
        for fault in IMAGE_FAULTS:
            first = photographs(SCENE.items(before, ball), STEREO, WEBCAM, rng)
            second = photographs(SCENE.items(now, ball, fault.extras), STEREO, WEBCAM, rng)
            for estimator in ESTIMATORS:
                eyes = HandoverVision(cameras, estimator)
                eyes.look(first)
                seen = eyes.look(fault.spoil(second, first)).observation
                errors = vision.look_errors(now, ball, seen, seen)
                row = {"fault": fault.name, "estimator": estimator, "pose": pose}
                row |= {what: verdict(errors[f"{what}_mm"]) for what in ("gripper", "ball")}
                rows.append({**row, "status": seen.status})
    return pd.DataFrame(rows)


def moved_apart(rng: Generator, distance: float = 0.03) -> tuple[Array, Array]:
    """Return two true states (9,) whose grippers are about a distance [m] apart."""
    state, direction = vision.random_states(1, rng)[0], 0.05 * rng.standard_normal(9)
    direction[2::3] = 0.0
    move = np.linalg.norm(SCENE.arm.tip_points(state + direction)[3:] - SCENE.arm.tip_points(state)[3:])
    return state, state + direction * distance / move


def verdict(miss: float) -> str:
    """Return what became of something whose error is known [mm], NaN where it was not seen."""
    if np.isnan(miss):
        return "refused"
    return "located" if miss <= LOCATED else "wrong"
