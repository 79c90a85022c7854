"""The cameras of the handover: images in, observation out. Frame `arm_base`, z down."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations, product

import numpy as np
from numpy.typing import NDArray

from soro_lib.checks import one_of
from soro_lib.sensing.camera import Image
from soro_lib.sensing.handover_observation import HandoverObservation
from soro_lib.sensing.marker_pose import (
    WristPose,
    average_pose,
    consensus_pose,
    joint_pose,
    viewing_cosines,
    wrist_candidates,
)
from soro_lib.sensing.marker_ring import MarkerRing
from soro_lib.sensing.stereo_vision import (
    CORNER_SHIFT,
    BallDetector,
    BallSight,
    CalibratedCamera,
    MarkerDetector,
    Window,
    around,
    ray_gap,
    triangulate,
)

ESTIMATORS = ("thesis", "gated", "joint")


@dataclass
class Look:
    """What was made of one set of images.

    Attributes
    ----------
    observation : HandoverObservation
    markers : list of dict
        Corners of the markers each camera sees, by id.
    balls : list of list of BallSight
        Green circles each camera sees.
    chosen : list of BallSight or None
        The circle of each camera that was taken for the ball.
    complaints : list of str
        Per camera "", or why its image was not used.
    """

    observation: HandoverObservation
    markers: list[dict[int, NDArray[np.float64]]]
    balls: list[list[BallSight]]
    chosen: list[BallSight | None]
    complaints: list[str]


@dataclass(frozen=True)
class Sight:
    """The markers that one camera sees, and where each alone puts the wrist.

    Attributes
    ----------
    camera : CalibratedCamera
    markers : dict
        Corners (4, 2) [px] by id, one marker at least.
    candidates : ndarray, shape (m, 2, 4, 4)
        Of :func:`wrist_candidates`.
    cosines : ndarray, shape (m, 2)
        Of :func:`viewing_cosines`.
    """

    camera: CalibratedCamera
    markers: dict[int, NDArray[np.float64]]
    candidates: NDArray[np.float64]
    cosines: NDArray[np.float64]


@dataclass
class HandoverVision:
    """Finds arm and ball in the images of two or more calibrated cameras.

    A camera whose image is missing, of another size or type, or exactly the one before (a sensor never takes
    the same picture twice) is left out: the arm is then known from the others, the ball only while two are
    left. If two cameras with at least two markers each put the wrist more than `largest_disagreement` apart,
    nothing is believed: cables or calibrations are swapped, or a camera was moved.

    Parameters
    ----------
    cameras : sequence of CalibratedCamera
    estimator : str
        "thesis", "gated" or "joint": :func:`average_pose`, :func:`consensus_pose`, :func:`joint_pose`. The
        thesis takes the largest green piece of each image for the ball; the others take together the pieces
        of a hidden ball and choose the circles whose rays meet.
    ring : MarkerRing
    gripper_length, ball_radius : float
        Known sizes [m].
    track : bool
        Whether markers and ball are looked for around their last place first.
    corner_shift : float
        Correction of the markers' corners [px].
    largest_disagreement : float
        See above [m].
    largest_gap : float
        Farthest that the rays to one ball may pass from each other [m].

    Raises
    ------
    ValueError
        If the estimator is unknown or there are fewer than two cameras.
    """

    cameras: Sequence[CalibratedCamera]
    estimator: str = "thesis"
    ring: MarkerRing = field(default_factory=MarkerRing)
    gripper_length: float = 0.10
    ball_radius: float = 0.020
    track: bool = True
    corner_shift: float = CORNER_SHIFT
    largest_disagreement: float = 0.10
    largest_gap: float = 0.010

    def __post_init__(self) -> None:
        one_of("estimator", self.estimator, ESTIMATORS)
        if len(self.cameras) < 2:
            raise ValueError(f"two cameras are needed at least, got {len(self.cameras)}")
        self.marker_detector = MarkerDetector(self.ring, corner_shift=self.corner_shift)
        self.ball_detector = BallDetector(join_pieces=self.estimator != "thesis")
        self.reset()

    def reset(self) -> None:
        """Forget earlier images."""
        count = len(self.cameras)
        self._last_pictures: list[bytes | None] = [None] * count
        self._marker_windows: list[Window | None] = [None] * count
        self._ball_windows: list[Window | None] = [None] * count
        self._last_points: NDArray[np.float64] | None = None
        self._last_ball: NDArray[np.float64] | None = None

    def look(self, images: Sequence[Image | None]) -> Look:
        """Return what the images (one per camera, blue, green, red) show.

        Raises
        ------
        ValueError
            If there are not as many images as cameras.
        """
        if len(images) != len(self.cameras):
            raise ValueError(f"{len(self.cameras)} cameras need as many images, got {len(images)}")
        complaints = [self._complaint(i, image) for i, image in enumerate(images)]
        usable = [image if not complaint else None for image, complaint in zip(images, complaints)]
        markers = [{} if image is None else self._markers(i, image) for i, image in enumerate(usable)]
        balls = [[] if image is None else self._balls(i, image) for i, image in enumerate(usable)]
        sights = self._sights(markers)
        pose = self._pose(sights, self.estimator)
        ball, gap, chosen = self._ball(balls)
        trouble = "" if pose else "no marker seen"
        apart = self._wrists_apart(sights)
        if apart > self.largest_disagreement:
            pose = ball = None
            trouble = f"the cameras put the wrist {1e3 * apart:.0f} mm apart: swapped or moved?"
        status = "; ".join(text for text in (trouble, *complaints) if text)
        observation = HandoverObservation(None, None, ball, disagreement=gap, status=status)
        if pose is not None:
            gripper = pose.wrist + self.gripper_length * pose.direction
            self._last_points = np.concatenate([pose.wrist, gripper])
            deviations = pose.wrist_deviation, pose.direction_deviation
            observation = HandoverObservation(
                pose.wrist, pose.direction, ball, *deviations, disagreement=gap, status=status
            )
        if ball is not None:
            clear = min(sight.fill for sight in chosen if sight is not None) > CLEAR_FILL
            observation = replace(observation, ball_deviation=0.001 if clear else 0.010)
        return Look(observation, markers, balls, chosen, complaints)

    def estimate(self, markers: Sequence[dict[int, NDArray[np.float64]]], estimator: str) -> WristPose | None:
        """Return the wrist that an estimator makes of the markers of each camera; None without markers."""
        return self._pose(self._sights(markers), estimator)

    def _sights(self, markers: Sequence[dict[int, NDArray[np.float64]]]) -> list[Sight]:
        """Return what the cameras make of their markers, of those that see any."""
        sights = []
        for camera, seen in zip(self.cameras, markers):
            if seen:
                candidates = wrist_candidates(seen, camera, self.ring)
                cosines = viewing_cosines(candidates, seen, camera, self.ring)
                sights.append(Sight(camera, seen, candidates, cosines))
        return sights

    def _pose(self, sights: Sequence[Sight], estimator: str) -> WristPose | None:
        if not sights:
            return None
        candidates = np.concatenate([sight.candidates for sight in sights])
        if estimator == "thesis":
            return average_pose(candidates)
        cosines = np.concatenate([sight.cosines for sight in sights])
        agreed = consensus_pose(candidates, cosines, self.gripper_length, self._last_points)
        if estimator == "gated" or agreed.pose is None:
            return agreed
        return joint_pose(agreed.pose, [(sight.camera, sight.markers) for sight in sights], self.ring)

    def _complaint(self, index: int, image: Image | None) -> str:
        """Return why an image cannot be used, or ""."""
        camera = self.cameras[index].camera
        last, self._last_pictures[index] = self._last_pictures[index], None
        if image is None or np.size(image) == 0:
            return f"camera {index + 1}: no image"
        if image.shape != (camera.height, camera.width, 3) or image.dtype != np.uint8:
            return (
                f"camera {index + 1}: image is {image.dtype} {image.shape}, "
                f"not uint8 ({camera.height}, {camera.width}, 3)"
            )
        picture = image[::16, ::16].tobytes()
        self._last_pictures[index] = picture
        return f"camera {index + 1}: frozen" if picture == last else ""

    def _markers(self, index: int, image: Image) -> dict[int, NDArray[np.float64]]:
        """Return the markers in an image, looked for around their last place, then everywhere."""
        window = self._marker_windows[index]
        seen = self.marker_detector.detect(image, window) if window else {}
        seen = seen or self.marker_detector.detect(image)
        self._marker_windows[index] = None
        if seen and self.track:
            corners = np.concatenate(list(seen.values()))
            middle = tuple(corners.mean(axis=0).tolist())
            self._marker_windows[index] = around(middle, np.ptp(corners, axis=0).max() / 2 + 80, image.shape)
        return seen

    def _balls(self, index: int, image: Image) -> list[BallSight]:
        """Return the green circles in an image, looked for around the ball's last place, then everywhere.

        The thesis searches the whole image every time.
        """
        window = None if self.estimator == "thesis" else self._ball_windows[index]
        found = self.ball_detector.detect(image, window) if window else []
        return found or self.ball_detector.detect(image)

    def _wrists_apart(self, sights: Sequence[Sight]) -> float:
        """Return how far apart the cameras put the wrist [m], of those that see two markers at least."""
        alone = [self._pose([sight], "gated") for sight in sights if len(sight.markers) >= 2]
        wrists = [pose.wrist for pose in alone if pose is not None]
        return max((float(np.linalg.norm(a - b)) for a, b in combinations(wrists, 2)), default=0.0)

    def _ball(
        self, balls: Sequence[list[BallSight]]
    ) -> tuple[NDArray[np.float64] | None, float, list[BallSight | None]]:
        """Return the ball's place (3,), the gap of its rays [m] and the circle taken from each camera."""
        chosen: list[BallSight | None] = [None] * len(balls)
        self._ball_windows = [None] * len(balls)
        seeing = [i for i, found in enumerate(balls) if found]
        meetings = list(self._meetings(balls, seeing))
        if not meetings:
            return None, 0.0, chosen
        last = self._last_ball
        if self.estimator == "thesis" or last is None:
            place, gap, taken = meetings[0]
        else:
            place, gap, taken = min(meetings, key=lambda meeting: float(np.linalg.norm(meeting[0] - last)))
        for i, sight in zip(seeing, taken):
            chosen[i] = sight
            if self.track:
                camera = self.cameras[i].camera
                size = camera.height, camera.width
                self._ball_windows[i] = around(sight.centre, 2 * sight.radius + 60, size)
        if self.track:
            self._last_ball = place
        return place, gap, chosen

    def _meetings(
        self, balls: Sequence[list[BallSight]], seeing: list[int]
    ) -> Iterator[tuple[NDArray[np.float64], float, tuple[BallSight, ...]]]:
        """Yield the place, the gap and the circles of every ball that the seeing cameras can agree on, the
        largest circles first; for the thesis, the largest circles alone, whether they agree or not."""
        if len(seeing) < 2:
            return
        if self.estimator == "thesis":
            largest = tuple(balls[i][0] for i in seeing)
            yield (*self._meet(seeing, largest), largest)
            return
        for sights in product(*(balls[i][:3] for i in seeing)):
            place, gap = self._meet(seeing, sights)
            if gap < self.largest_gap and self._right_size(seeing, sights, place):
                yield place, gap, sights

    def _meet(self, seeing: list[int], sights: tuple[BallSight, ...]) -> tuple[NDArray[np.float64], float]:
        rays = [self.cameras[i].rays([sight.centre]) for i, sight in zip(seeing, sights)]
        origins = np.array([origin for origin, _ in rays])
        directions = np.array([direction[0] for _, direction in rays])
        return triangulate(origins, directions), ray_gap(origins, directions)

    def _right_size(
        self, seeing: list[int], sights: tuple[BallSight, ...], place: NDArray[np.float64]
    ) -> bool:
        """Return whether no circle is larger than the ball could be there, or far too small."""
        for i, sight in zip(seeing, sights):
            camera = self.cameras[i]
            expected = (
                camera.camera.focal_length * self.ball_radius / np.linalg.norm(place - camera.pose[:3, 3])
            )
            if not 0.4 * expected <= sight.radius <= 1.3 * expected:
                return False
        return True


CLEAR_FILL = 0.85
"""Green share of its circle above which a ball counts as unhidden."""
