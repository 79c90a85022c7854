"""Six flights of the camera: two scenes, undisturbed, with moving obstacles and with varying light.

Every frame is rendered, disturbed and tracked; what the tracker says is stored per frame, so that everything
after it (learning, fusion, tables) runs in seconds. The tracker sees images only. The one thing it is told is
the similarity of Eq. (30), fitted on a sweep before the run to an electromagnetic tracker, as in the paper
(Wang et al., Secs. IV-B and IV-C).
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from threadpoolctl import threadpool_limits

from soro_lib.papers.visual_strain_fusion.world import scene as surroundings
from soro_lib.papers.visual_strain_fusion.world.motion import ArmMotion, move, spiral
from soro_lib.papers.visual_strain_fusion.world.scene import ENDOSCOPE, BrickScene, ViewConditions, photograph
from soro_lib.project import data_directory
from soro_lib.replication.datacards import verified
from soro_lib.sensing.monocular_vision import MonocularTracker, TrackedFrame, fit_similarity

Array = NDArray[np.float64]
Similarity = tuple[Array, float, Array]
"""Rotation (3, 3), scale and translation (3,) from the map to the world (Wang et al., Eq. (30))."""

SLUG = "visual_strain_fusion"

EM_NOISE = 1e-4
"""Standard deviation of one coordinate of the electromagnetic tracker [m]; the paper prints none."""


@dataclass(frozen=True)
class Flight:
    """One run: which scene, which disturbance."""

    scene: int
    timeline: surroundings.Timeline
    disturbance: str


FLIGHTS = {
    "scene1_undisturbed": Flight(1, surroundings.undisturbed, "nothing"),
    "scene2_undisturbed": Flight(2, surroundings.undisturbed, "nothing"),
    "scene1_obstacles": Flight(1, surroundings.moving_obstacles, "moving obstacles"),
    "scene1_light": Flight(1, surroundings.varying_light, "varying light"),
    "scene2_obstacles": Flight(2, surroundings.moving_obstacles, "moving obstacles"),
    "scene2_light": Flight(2, surroundings.varying_light, "varying light"),
}
"""The stored runs; settings were chosen on scene 1 and applied unchanged to scene 2."""

COLUMNS = {
    "time_s": "[s] since the start of the spiral",
    "phase": "[-] number of the condition in the paper's Fig. 6(a) or 7(a); 1 is undisturbed",
    "tracked": "[-] 1 if the frame gave a pose, 0 if the last valid one is repeated",
    "features": "[-] ORB features in the image",
    "matches": "[-] features matched to the map",
    "inliers": "[-] matches that fit the pose",
    "inlier_error_px": "[px] mean reprojection error of the inliers, the paper's e_S; empty if lost",
    "match_error_px": "[px] mean reprojection error of all matches, each limited to 10; empty if lost",
    "spread_mm": "[mm] standard deviation of the position by the Jacobian of the reprojection; empty if lost",
    "x_mm": "[mm] tip position by the camera, in the frame of the tip at rest",
    "y_mm": "[mm] tip position by the camera",
    "z_mm": "[mm] tip position by the camera, down",
    "qx": "[-] tip orientation by the camera, unit quaternion",
    "qy": "[-] tip orientation by the camera",
    "qz": "[-] tip orientation by the camera",
    "qw": "[-] tip orientation by the camera, scalar",
    "true_x_mm": "[mm] true tip position, never shown to the tracker",
    "true_y_mm": "[mm] true tip position",
    "true_z_mm": "[mm] true tip position, down",
}
"""Columns of a recording, with units."""

MAP_ARRAYS = {
    "positions": "[m] map points, frame of the tip at rest, (n, 3)",
    "descriptors": "[-] ORB descriptors of the points, (n, 32)",
    "directions": "[-] unit direction from which each point was first seen, (n, 3)",
}
"""Arrays of a stored map, with units."""


def calibration_sweep() -> ArmMotion:
    """Return the slow sweep along x and along y before a run, there and back, twice.

    It goes to a bending angle of 0.4 rad, 3 s from the middle to the end.
    """
    out = np.linspace(0.0, 0.4, 60)
    leg, rest = np.concatenate([out, out[::-1]]), np.zeros(120)
    once = np.concatenate([np.stack([leg, rest], axis=-1), np.stack([rest, leg], axis=-1)])
    return move(np.concatenate([once, once]))


def start_tracker(scene: BrickScene, rng: np.random.Generator) -> tuple[MonocularTracker, Similarity]:
    """Return a tracker with a first map, and its similarity to the world (Eq. (30)).

    The first sweep builds the map; the second, seen by camera and electromagnetic tracker, gives the scale.

    Raises
    ------
    RuntimeError
        If the tracker found no map on the sweep.
    """
    tracker = MonocularTracker(ENDOSCOPE)
    sweep = calibration_sweep()
    seen, measured = [], []
    for step, pose in enumerate(sweep.pose):
        frame = tracker.track(photograph(scene, pose, ViewConditions(), _noise(rng)))
        if frame.tracked and step >= len(sweep.pose) // 2:
            seen.append(frame.pose[:3, 3])
            measured.append(pose[:3] + rng.normal(0.0, EM_NOISE, 3))
    if len(seen) < 10:
        raise RuntimeError(f"the tracker has no map after the sweep: only {len(seen)} frames gave a pose")
    return tracker, fit_similarity(seen, measured)


def fly(
    flight: Flight, seed: int, steps: int, report: Callable[[int], None] = lambda frames: None
) -> tuple[pd.DataFrame, dict[str, NDArray[Any]]]:
    """Render and track one run.

    Parameters
    ----------
    flight : Flight
        Scene and disturbance.
    seed : int
        Of the sensor noise and the noise of the electromagnetic tracker.
    steps : int
        Steps of 0.05 s; the spiral ends early if fewer than 4000.
    report : callable, optional
        Called with the number of the frame just done.

    Returns
    -------
    frames : DataFrame
        One row per frame, columns :data:`COLUMNS`.
    point_map : dict of arrays
        The map at the end, :data:`MAP_ARRAYS`.
    """
    rng = np.random.default_rng([seed, *flight.disturbance.encode()])
    cv2.setNumThreads(1)
    with threadpool_limits(1):
        scene, motion = BrickScene(flight.scene), spiral()
        tracker, similarity = start_tracker(scene, rng)
        rows = []
        for step in range(steps):
            conditions = flight.timeline(motion.time[step])
            frame = tracker.track(photograph(scene, motion.pose[step], conditions, _noise(rng)))
            measured = _row(frame, similarity)
            rows.append([motion.time[step], conditions.phase, *measured, *1e3 * motion.pose[step, :3]])
            report(step + 1)
    rotation, scale, translation = similarity
    positions = (scale * tracker.map.positions @ rotation.T + translation).astype(np.float32)
    directions = (tracker.map.directions @ rotation.T).astype(np.float32)
    arrays = (positions, tracker.map.descriptors, directions)
    return pd.DataFrame(rows, columns=pd.Index(COLUMNS)), dict(zip(MAP_ARRAYS, arrays))


def metric_pose(pose: Array, similarity: Similarity) -> Array:
    """Return a pose (7,) in the world from one (4, 4) in the map (Wang et al., Eq. (30))."""
    rotation, scale, translation = similarity
    quaternion = Rotation.from_matrix(rotation @ pose[:3, :3]).as_quat(canonical=True)
    return np.concatenate([scale * rotation @ pose[:3, 3] + translation, quaternion])


def _row(frame: TrackedFrame, similarity: Similarity) -> list[float]:
    """Return what a recording holds of a tracked frame, from "tracked" to the quaternion."""
    pose = metric_pose(frame.pose, similarity)
    errors = [frame.inlier_error, frame.match_error, 1e3 * similarity[1] * frame.position_spread]
    if not frame.tracked:
        errors = [np.nan] * 3
    counts = (int(frame.tracked), frame.features, frame.matches, frame.inliers)
    return [*counts, *errors, *1e3 * pose[:3], *pose[3:]]


def _noise(rng: np.random.Generator) -> NDArray[np.float32]:
    return rng.standard_normal((ENDOSCOPE.height, ENDOSCOPE.width), dtype=np.float32)


def load_flight(name: str) -> pd.DataFrame:
    """Return the stored frames of a flight, one of :data:`FLIGHTS`, checked against its card.

    Raises
    ------
    KeyError
        If there is no such flight.
    DataCardError
        If the recording does not match its card.
    """
    return pd.read_csv(_stored(name, ".csv.gz"))


def load_map(name: str) -> dict[str, NDArray[Any]]:
    """Return the stored map of a flight, arrays :data:`MAP_ARRAYS`."""
    with np.load(_stored(name, "_map.npz")) as arrays:
        return {key: arrays[key] for key in MAP_ARRAYS}


def _stored(name: str, ending: str) -> Path:
    if name not in FLIGHTS:
        raise KeyError(f"no flight {name!r}; there are {', '.join(FLIGHTS)}")
    return verified(data_directory(SLUG) / f"{name}{ending}")
