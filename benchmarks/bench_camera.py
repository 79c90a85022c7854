"""The camera pipeline: one frame tracked, against plain OpenCV; a recorded flight fused with a fibre."""

import copy
from collections.abc import Callable

import cv2
import numpy as np

from benchmarks.run import Row, compare, seconds_per_call
from soro_lib.estimators.extreme_learning_machine import ExtremeLearningMachine
from soro_lib.estimators.pose_fusion import fuse_poses
from soro_lib.estimators.visual_strain import VisualStrainEstimator
from soro_lib.papers.visual_strain_fusion.experiments.camera_runs import load_flight, start_tracker
from soro_lib.papers.visual_strain_fusion.experiments.fusion_runs import camera_poses
from soro_lib.papers.visual_strain_fusion.world.motion import glue_fibre, spiral
from soro_lib.papers.visual_strain_fusion.world.scene import ENDOSCOPE, BrickScene, ViewConditions, photograph
from soro_lib.sensing.monocular_vision import PointMap

PAPER_PERIOD_MS = 50.0
"""The paper's slowest rate, 20 Hz."""


def rows() -> list[Row]:
    """Measure the camera pipeline on one core."""
    cv2.setNumThreads(1)
    return [*_pipeline(), *_fusion()]


def _pipeline() -> list[Row]:
    rng = np.random.default_rng(1)
    scene = BrickScene(1)
    tracker, _ = start_tracker(scene, rng)
    noise = rng.standard_normal((ENDOSCOPE.height, ENDOSCOPE.width), dtype=np.float32)
    for pose in spiral().pose[:20]:
        image = photograph(scene, pose, ViewConditions(), noise)
        frame = tracker.track(image)
    orb = cv2.ORB.create(600, fastThreshold=10)
    peers: dict[str, Callable[[], object] | None] = {
        "plain OpenCV: ORB, knnMatch, solvePnPRansac": lambda: _plain_pose(orb, image, tracker.map),
        "OpenCV's ORB alone": lambda: orb.detectAndCompute(image, None),
    }
    size = f"{frame.features} features, {frame.inliers} inliers"
    found = 1e3 * seconds_per_call(lambda: tracker.find(image))
    measured = [
        *compare("camera pipeline, one frame", lambda: tracker.track(image), peers, "ms", 12.5),
        Row(
            "camera lost, search of the whole map", found, "ms",
            f"20 Hz of the paper: 50 ms; {size}, map of {len(tracker.map)} points",
            PAPER_PERIOD_MS / found, 25.0,
        ),
    ]  # fmt: skip
    render = 1e3 * seconds_per_call(lambda: photograph(scene, pose, ViewConditions(), noise))
    return [*measured, Row("one frame rendered, 54 textured quads and sensor noise", render, "ms", "none")]


def _plain_pose(orb: cv2.ORB, image: np.ndarray, point_map: PointMap) -> int:
    """Locate the camera as OpenCV's tutorials do, in the map of ours; return how many matches agree."""
    keypoints, descriptors = orb.detectAndCompute(image, None)
    pairs = cv2.BFMatcher(cv2.NORM_HAMMING).knnMatch(descriptors, point_map.descriptors, k=2)
    good = [best for best, second in pairs if best.distance < 0.75 * second.distance]
    world = point_map.positions[[match.trainIdx for match in good]]
    pixels = np.array([keypoints[match.queryIdx].pt for match in good])
    _, _, _, inliers = cv2.solvePnPRansac(world, pixels, ENDOSCOPE.matrix, None, reprojectionError=4.0)
    if inliers is None or len(inliers) < 25:
        raise ValueError("the plain way does not find the camera")
    return len(inliers)


def _fusion() -> list[Row]:
    frames, motion = load_flight("scene1_obstacles"), spiral()
    camera = camera_poses(frames)
    error = frames["match_error_px"].fillna(np.inf).to_numpy()
    inliers = frames["inliers"].to_numpy()
    rng = np.random.default_rng(1)
    shifts = glue_fibre(rng).shift(motion.configuration, motion.elongations, rng)
    untrained = VisualStrainEstimator(ExtremeLearningMachine(rng))

    def learn_and_fuse() -> None:
        estimator = copy.deepcopy(untrained)
        for sample in zip(motion.time, shifts, camera, error, inliers):
            estimator.update(*sample)

    flight = len(frames) * PAPER_PERIOD_MS / 1e3
    both = seconds_per_call(learn_and_fuse, repeats=2)
    alone = seconds_per_call(lambda: fuse_poses(camera, camera[::-1], error))
    return [
        Row("4,000 recorded frames, Eq. (18)", alone, "s", f"flight: {flight:.0f} s", flight / alone, 0.5),
        Row(
            "4,000 recorded frames, learned online and fused",
            both,
            "s",
            f"flight: {flight:.0f} s",
            flight / both,
        ),
    ]
