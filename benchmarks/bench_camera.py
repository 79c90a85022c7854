"""The camera pipeline: one frame rendered, tracked, relocalised; a recorded flight fused with a fibre."""

import copy
from collections.abc import Callable

import cv2
import numpy as np

from benchmarks.run import Row, seconds_per_call
from soro_lib.estimators.extreme_learning_machine import ExtremeLearningMachine
from soro_lib.estimators.pose_fusion import fuse_poses
from soro_lib.estimators.visual_strain import VisualStrainEstimator
from soro_lib.sensing.monocular_scene import ENDOSCOPE, BrickScene, ViewConditions, photograph
from soro_lib.studies.visual_strain_fusion.camera_runs import load_flight, start_tracker
from soro_lib.studies.visual_strain_fusion.fusion_runs import camera_poses
from soro_lib.studies.visual_strain_fusion.motion import glue_fibre, spiral

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
    plain = cv2.ORB.create(600, fastThreshold=10)
    orb = 1e3 * seconds_per_call(lambda: plain.detectAndCompute(image, None))
    size = f"640x480, {frame.features} features, {frame.inliers} inliers"
    timed: dict[str, Callable[[], object]] = {
        f"camera pipeline, one frame ({size})": lambda: tracker.track(image),
        f"camera lost, search of the whole map ({len(tracker.map)} points)": lambda: tracker.find(image),
    }
    measured = [
        Row(
            name, value := 1e3 * seconds_per_call(call), "ms",
            f"20 Hz of the paper: 50 ms; OpenCV's ORB alone: {orb:.1f} ms", PAPER_PERIOD_MS / value, 25.0,
        )
        for name, call in timed.items()
    ]  # fmt: skip
    render = 1e3 * seconds_per_call(lambda: photograph(scene, pose, ViewConditions(), noise))
    return [*measured, Row("one frame rendered, 54 textured quads and sensor noise", render, "ms", "none")]


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
