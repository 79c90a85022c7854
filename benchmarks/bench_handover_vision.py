"""One look of the handover's cameras: two 1280 x 720 pictures rendered, arm and ball found in them.

The peer is the same detection as the thesis describes it, without the shortcuts here: the whole picture
undistorted and searched every time.
"""

import cv2
import numpy as np

from benchmarks.run import Row, compare, seconds_per_call
from soro_lib.sensing.handover_scene import STEREO, WEBCAM, HandoverScene, photograph
from soro_lib.sensing.rendered_observation import HandoverVision, RenderedObserver
from soro_lib.sensing.stereo_vision import BallDetector, CalibratedCamera, MarkerDetector, around


def rows() -> list[Row]:
    """Return the comparisons of rendering and detection."""
    cv2.setNumThreads(1)
    scene = HandoverScene()
    state = scene.arm.home.copy()
    state[[3, 4, 6, 7]] = -0.5, 0.2, 0.25, -0.1
    ball = scene.arm.tip_points(state)[3:] + np.array([-0.06, 0.02, 0.05])
    cameras = [CalibratedCamera(view.camera, view.pose) for view in STEREO]
    rng = np.random.default_rng(1)
    pictures = [[photograph(scene.items(state, ball), v, WEBCAM, rng) for v in STEREO] for _ in range(2)]
    observer = RenderedObserver(HandoverVision(cameras, "joint"))
    vision = HandoverVision(cameras, "joint")
    turn = 0

    def tracked() -> None:
        """Look at two pairs of pictures in turn: a picture that repeats would count as frozen."""
        nonlocal turn
        turn = 1 - turn
        vision.look(pictures[turn])

    def whole() -> None:
        """Undistort and search the whole pictures."""
        markers, balls = MarkerDetector(scene.ring), BallDetector()
        for camera, picture in zip(cameras, pictures[0]):
            flat = cv2.undistort(picture, camera.camera.matrix, camera.camera.coefficients)
            markers.detect(flat)
            balls.detect(flat, around((640, 360), 1280, flat.shape))

    def rendered() -> None:
        items = scene.items(state, ball)
        for view in STEREO:
            photograph(items, view, WEBCAM, rng)

    whole_look = seconds_per_call(lambda: observer.observe(state, ball, rng)) * 1e3
    drawing = seconds_per_call(rendered) * 1e3
    return [
        Row("handover: two pictures rendered and searched", whole_look, "ms", "", None, 25.0),
        Row("handover: two pictures rendered", drawing, "ms", "", None, 15.0),
        *compare(
            "handover: arm and ball found in two pictures",
            tracked,
            {"whole pictures undistorted and searched": whole},
            unit="ms",
            goal=10.0,
        ),
    ]
