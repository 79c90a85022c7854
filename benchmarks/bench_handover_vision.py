"""Handover steps with cameras: two 1280 x 720 pictures rendered, arm and ball found in them, a command.

The peer is the same detection as the thesis describes it, without the shortcuts here: the whole picture
undistorted and searched every time.
"""

import time
from collections.abc import Sequence

import cv2
import numpy as np

from benchmarks.run import Row, compare, seconds_per_call
from soro_lib.controllers.handover import HandoverController
from soro_lib.papers.soft_handover.calibration import plant_k
from soro_lib.papers.soft_handover.experiments.handover import HOLDER, thesis_parameters
from soro_lib.papers.soft_handover.world.observer import RenderedObserver
from soro_lib.papers.soft_handover.world.scene import STEREO, WEBCAM, HandoverScene, photograph
from soro_lib.sensing.handover_vision import HandoverVision
from soro_lib.sensing.marker_ring import MarkerRing
from soro_lib.sensing.stereo_vision import BallDetector, CalibratedCamera, MarkerDetector, around

CAMERAS = [CalibratedCamera(view.camera, view.pose) for view in STEREO]
STEPS, HANDOVERS = 15, 4


def rows() -> list[Row]:
    """Return the comparisons of rendering and detection."""
    cv2.setNumThreads(1)
    scene = HandoverScene()
    state = scene.arm.home.copy()
    state[[3, 4, 6, 7]] = -0.5, 0.2, 0.25, -0.1
    ball = scene.arm.tip_points(state)[3:] + np.array([-0.06, 0.02, 0.05])
    rng = np.random.default_rng(1)
    pictures = [[photograph(scene.items(state, ball), v, WEBCAM, rng) for v in STEREO] for _ in range(2)]
    observer = RenderedObserver(HandoverVision(CAMERAS, "joint"))
    vision = HandoverVision(CAMERAS, "joint")
    turn = 0

    def tracked() -> None:
        """Look at two pairs of pictures in turn: a picture that repeats would count as frozen."""
        nonlocal turn
        turn = 1 - turn
        vision.look(pictures[turn])

    def rendered() -> None:
        items = scene.items(state, ball)
        for view in STEREO:
            photograph(items, view, WEBCAM, rng)

    whole_look = seconds_per_call(lambda: observer.observe(state, ball, rng)) * 1e3
    drawing = seconds_per_call(rendered) * 1e3
    return [
        handover_step(),
        Row("handover: two pictures rendered and searched", whole_look, "ms", "", None, 25.0),
        Row("handover: two pictures rendered", drawing, "ms", "", None, 15.0),
        *compare(
            "handover: arm and ball found in two pictures",
            tracked,
            {"whole pictures undistorted and searched": lambda: search_whole(pictures[0], scene.ring)},
            unit="ms",
            goal=10.0,
        ),
    ]


def search_whole(pictures: Sequence[np.ndarray], ring: MarkerRing) -> None:
    """Undistort and search whole pictures."""
    markers, balls = MarkerDetector(ring), BallDetector()
    for camera, picture in zip(CAMERAS, pictures):
        flat = cv2.undistort(picture, camera.camera.matrix, camera.camera.coefficients)
        markers.detect(flat)
        balls.detect(flat, around((640, 360), 1280, flat.shape))


def handover_step() -> Row:
    """Time steps of moving arms: pictures rendered, looked at, answered with a command; the median.

    In the peer's step the same pictures are searched the straightforward way, without a pose made of it.
    """
    scene, vision, plant = HandoverScene(), HandoverVision(CAMERAS, "joint"), plant_k()
    controller, rng = HandoverController(thesis_parameters(0.1)), np.random.default_rng(1)
    calibrated = scene.arm.tendon_lengths(scene.arm.home)
    ours, theirs = [], []
    for _ in range(HANDOVERS):
        for part in (controller, vision, plant):
            part.reset()
        ball = HOLDER.ball("front", rng)
        state = plant.settle(calibrated)
        for _ in range(STEPS):
            marks = [time.process_time()]
            items = scene.items(state, ball)
            pictures = [photograph(items, view, WEBCAM, rng) for view in STEREO]
            marks.append(time.process_time())
            look = vision.look(pictures)
            marks.append(time.process_time())
            command = controller.update(look.observation)
            marks.append(time.process_time())
            search_whole(pictures, scene.ring)
            marks.append(time.process_time())
            drawing, looking, answering, searching = np.diff(marks)
            ours.append(drawing + looking + answering)
            theirs.append(drawing + searching + answering)
            state = plant.settle(calibrated + command.tendon_change)
    step, straightforward = 1e3 * float(np.median(ours)), 1e3 * float(np.median(theirs))
    return Row(
        "handover: control step with two rendered pictures", step, "ms",
        f"whole pictures undistorted and searched: {straightforward:.3g} ms", straightforward / step, 15.0,
    )  # fmt: skip
