"""Where the camera is, from its pictures alone: a small monocular SLAM (Wang et al., Sec. II-B).

It stands in for ORB-SLAM2: ORB features are matched to a map of points, the pose follows from
perspective-n-point with RANSAC and is refined on the inliers; keyframes add points by triangulation and are
adjusted together with their neighbours. Lost, the camera is found again by matching against the whole map.
The map has no scale of its own: :func:`fit_similarity` is Eq. (30).

The map's frame is the first camera's. Lengths in it are in units of the first median depth.
"""

from dataclasses import dataclass, field, replace

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from soro_lib.checks import check_fields, numbers
from soro_lib.sensing.bundle_adjustment import adjust, projection_jacobian
from soro_lib.sensing.camera import Camera, invert_pose, transform_points
from soro_lib.sensing.feature_matching import FeatureDetector, Features, match_descriptors, match_near

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


@dataclass(frozen=True)
class TrackerSettings:
    """Settings of the tracker; lengths are parts of the median depth of the scene.

    They were chosen on the first scene of the study and applied unchanged to the second.

    Attributes
    ----------
    features : int
        Most features per image (Wang et al., Sec. IV-C1: around 600).
    cells : int
        Cells along the image's longer side; the strongest features of each are taken in turn.
    levels : int
        Levels of the image pyramid, a factor 1.2 apart.
    corner_threshold : int
        Threshold of the FAST corner test [grey levels].
    gate : float
        A feature may lie this far from where the map point is expected [px].
    gate_growth, largest_gate : float
        Growth of the gate per lost frame, and its largest value [px].
    hamming : int
        Largest number of differing bits of 256 in a match.
    ratio : float
        The best match must have less than this part of the bits of the second best.
    inlier_error : float
        Largest reprojection error of an inlier [px].
    tracked_inliers : int
        Fewest inliers of a tracked frame.
    relocalised_inliers : int
        Fewest inliers of a frame found again.
    relocalise_every : int
        While lost, the whole map is searched every so many frames.
    keyframe_distance : float
        A keyframe is added when all others are farther than this [median depth].
    keyframe_inliers : int
        Fewest inliers of a keyframe: no map is built on a poor pose.
    parallax : float
        Smallest angle between the rays of a triangulated point [rad].
    keyframe_share : float
        A keyframe is added at a third of that distance already when the inliers have fallen below this part
        of the points of the nearest keyframe.
    first_points : int
        Fewest points of the first map.
    first_parallax : float
        Median angle between the rays of the first two keyframes [rad].
    window : int
        Keyframes that are adjusted together when one is added.
    """

    features: int = 600
    cells: int = 10
    levels: int = 6
    corner_threshold: int = 10
    gate: float = 25.0
    gate_growth: float = 6.0
    largest_gate: float = 60.0
    hamming: int = 60
    ratio: float = 0.9
    inlier_error: float = 4.0
    tracked_inliers: int = 15
    relocalised_inliers: int = 25
    relocalise_every: int = 4
    keyframe_distance: float = 0.05
    keyframe_inliers: int = 50
    keyframe_share: float = 0.6
    first_points: int = 80
    parallax: float = 0.03
    first_parallax: float = 0.06
    window: int = 6

    def __post_init__(self) -> None:
        check_fields(self, above=0)


@dataclass(frozen=True)
class Keyframe:
    """A view kept for the map: its pose in it, its features and the map point of each (-1 for none).

    The arrays are changed in place when points are added or adjusted.
    """

    pose: Array
    features: Features
    points: Indices


@dataclass(frozen=True)
class TrackedFrame:
    """What the tracker says about one image.

    Attributes
    ----------
    pose : ndarray (4, 4)
        ``camera_in_map``; the latest valid one if the frame is lost.
    tracked : bool
        Whether this frame gave a pose.
    features, matches, inliers : int
        Number of features in the image, of those matched to the map, and of those that fit the pose.
    inlier_error : float
        Mean reprojection error of the inliers, the paper's e_S [px]; infinite if lost.
    match_error : float
        Mean reprojection error of all matches, each limited to 10 px; infinite if lost [px].
    position_spread : float
        Standard deviation of the position by the curvature of the reprojection error, root of the trace
        [median depth]; infinite if lost.
    inlier_pixels, other_pixels : ndarray (n, 2)
        Where the inliers and the other features are [px], for pictures.
    """

    pose: Array
    tracked: bool
    features: int = 0
    matches: int = 0
    inliers: int = 0
    inlier_error: float = np.inf
    match_error: float = np.inf
    position_spread: float = np.inf
    inlier_pixels: Array = field(default_factory=lambda: np.zeros((0, 2)))
    other_pixels: Array = field(default_factory=lambda: np.zeros((0, 2)))


class PointMap:
    """Points with the descriptor and the direction from which each was first seen."""

    def __init__(self) -> None:
        self.positions = np.zeros((0, 3))
        self.descriptors = np.zeros((0, 32), dtype=np.uint8)
        self.directions = np.zeros((0, 3))

    def __len__(self) -> int:
        return len(self.positions)

    def add(self, positions: Array, descriptors: NDArray[np.uint8], viewpoint: Array) -> Indices:
        """Add points (n, 3) seen from a viewpoint (3,); return their indices."""
        seen = positions - viewpoint
        self.positions = np.vstack([self.positions, positions])
        self.descriptors = np.vstack([self.descriptors, descriptors])
        self.directions = np.vstack([self.directions, seen / np.linalg.norm(seen, axis=1, keepdims=True)])
        return np.arange(len(self) - len(positions), len(self))


class MonocularTracker:
    """Monocular SLAM: call :meth:`track` with one image after the other.

    Parameters
    ----------
    camera : Camera
        Calibrated camera.
    settings : TrackerSettings, optional
        Thresholds.
    point_map : PointMap, optional
        A map made before, for :meth:`find`; :meth:`track` makes its own.
    """

    def __init__(
        self, camera: Camera, settings: TrackerSettings | None = None, point_map: PointMap | None = None
    ) -> None:
        self.camera = camera
        self.settings = settings or TrackerSettings()
        self.map = point_map or PointMap()
        self.keyframes: list[Keyframe] = []
        self._detector = FeatureDetector(
            camera,
            self.settings.features,
            self.settings.cells,
            self.settings.levels,
            self.settings.corner_threshold,
        )
        self._reference: Features | None = None
        self._pose = np.eye(4)
        self._motion = np.eye(4)
        self._lost = 0

    @property
    def initialised(self) -> bool:
        """Whether there is a map."""
        return len(self.keyframes) > 0

    def track(self, image: NDArray[np.uint8] | None) -> TrackedFrame:
        """Return the pose of the camera that took the image.

        Parameters
        ----------
        image : array (height, width) or (height, width, 3), uint8, or None
            Next image; None if the camera delivered none, which counts as a lost frame.

        Returns
        -------
        TrackedFrame

        Raises
        ------
        ValueError
            If the image has the wrong size or type.
        """
        features = self._detector.detect(image)
        if not self.initialised and not self._initialise(features):
            return TrackedFrame(self._pose, False, len(features))
        if self._lost and self._lost % self.settings.relocalise_every == 0:
            frame, owner = self._relocalise(features)
        else:
            gate = min(
                self.settings.gate + self.settings.gate_growth * self._lost, self.settings.largest_gate
            )
            predicted = self._pose if self._lost else self._pose @ self._motion
            frame, owner = self._locate(features, predicted, gate)
        if not frame.tracked:
            self._lost += 1
            return replace(frame, pose=self._pose)
        self._motion = np.eye(4) if self._lost else invert_pose(self._pose) @ frame.pose
        self._pose, self._lost = frame.pose, 0
        if self._is_new(frame):
            self._add_keyframe(frame.pose, features, owner)
        return replace(frame, pose=self._pose)

    def find(self, image: NDArray[np.uint8] | None, near: Array | None = None) -> TrackedFrame:
        """Locate the camera in the map as it is, without tracking on from there.

        Parameters
        ----------
        image : array or None
            As for :meth:`track`.
        near : ndarray (4, 4), optional
            Where the camera is thought to be; without it the whole map is searched.

        Returns
        -------
        TrackedFrame
            With ``near`` (or the identity) as its pose if the camera was not found.
        """
        features = self._detector.detect(image)
        frame, _ = (
            self._relocalise(features) if near is None else self._locate(features, near, self.settings.gate)
        )
        return frame if frame.tracked else replace(frame, pose=np.eye(4) if near is None else near)

    def _initialise(self, features: Features) -> bool:
        """Triangulate the first map once two views have enough parallax; return whether there is one."""
        settings = self.settings
        if self._reference is None or len(self._reference) < settings.first_points:
            self._reference = features
            return False
        first, second = match_descriptors(self._reference, features, settings.hamming)
        before, now = self._reference.pixels[first], features.pixels[second]
        if len(first) < settings.first_points:
            return False
        essential, mask = cv2.findEssentialMat(before, now, self.camera.matrix, cv2.RANSAC, 0.999, 1.0)
        if essential is None or essential.shape != (3, 3):
            return False
        count, rotation, translation, mask = cv2.recoverPose(
            essential, before, now, self.camera.matrix, mask=mask
        )
        if count < settings.first_points:
            return False
        pose = _camera_pose(rotation, translation)
        inside = mask.ravel() > 0
        positions, angle = self._meet(np.eye(4), before[inside], pose, now[inside])
        if np.median(angle) < settings.first_parallax:
            return False
        pose[:3, 3] /= np.median(positions[:, 2])
        self.keyframes.append(Keyframe(np.eye(4), self._reference, np.full(len(self._reference), -1)))
        self._add_keyframe(pose, features, np.full(len(features), -1))
        return True

    def _locate(self, features: Features, predicted: Array, gate: float) -> tuple[TrackedFrame, Indices]:
        """Locate the camera by the map points expected in view."""
        candidates, expected = self._visible(predicted)
        descriptors = self.map.descriptors[candidates]
        chosen, matched = match_near(
            expected, descriptors, features, gate, self.settings.hamming, self.settings.ratio
        )
        return self._solve(features, candidates[chosen], matched, self.settings.tracked_inliers, rounds=60)

    def _relocalise(self, features: Features) -> tuple[TrackedFrame, Indices]:
        """Locate the camera by the whole map, without any idea where it is."""
        everything = Features(self.map.positions, self.map.descriptors)
        matched, points = match_descriptors(features, everything, self.settings.hamming)
        return self._solve(features, points, matched, self.settings.relocalised_inliers, rounds=300)

    def _visible(self, pose: Array) -> tuple[Indices, Array]:
        """Return map points that a camera at ``pose`` should see, and their pixels (n, 2)."""
        local = transform_points(invert_pose(pose), self.map.positions)
        seen = self.map.positions - pose[:3, 3]
        facing = np.einsum("ij,ij->i", seen, self.map.directions) > 0.7 * np.linalg.norm(seen, axis=1)
        front = np.flatnonzero((local[:, 2] > 0.05) & facing)
        pixels = self.camera.matrix[0, 0] * local[front, :2] / local[front, 2:] + self.camera.matrix[:2, 2]
        inside = ((pixels > 0) & (pixels < (self.camera.width, self.camera.height))).all(axis=1)
        return front[inside], pixels[inside]

    def _solve(
        self, features: Features, points: Indices, matched: Indices, fewest: int, rounds: int
    ) -> tuple[TrackedFrame, Indices]:
        """Solve perspective-n-point for the matches; also return the map point of every feature, or -1."""
        world, pixels = self.map.positions[points], features.pixels[matched]
        pose, error = self._perspective(world, pixels, rounds)
        inliers = np.flatnonzero(error < self.settings.inlier_error)
        owner = np.full(len(features), -1)
        counts = len(features), len(points), len(inliers)
        if pose is None or len(inliers) < fewest:
            return TrackedFrame(np.full((4, 4), np.nan), False, *counts, other_pixels=features.pixels), owner
        owner[matched[inliers]] = points[inliers]
        frame = TrackedFrame(
            pose,
            True,
            *counts,
            float(error[inliers].mean()),
            float(np.minimum(error, 10.0).mean()),
            self._spread(pose, world[inliers], error[inliers]),
            features.pixels[owner >= 0],
            features.pixels[owner < 0],
        )
        return frame, owner

    def _perspective(self, world: Array, pixels: Array, rounds: int) -> tuple[Array | None, Array]:
        """Return the pose from points (n, 3) and pixels (n, 2) by RANSAC and refinement, and the errors (n,).

        Without six points that agree there is no pose.
        """
        error = np.full(len(world), np.inf)
        if len(world) < 6:
            return None, error
        found, rotation, translation, chosen = cv2.solvePnPRansac(
            world,
            pixels,
            self.camera.matrix,
            None,
            iterationsCount=rounds,
            reprojectionError=self.settings.inlier_error,
            confidence=0.999,
            flags=cv2.SOLVEPNP_EPNP,
        )
        if not found or chosen is None or len(chosen) < 6:
            return None, error
        inliers = chosen[:, 0].astype(np.intp)
        for _ in range(2):
            rotation, translation = cv2.solvePnPRefineLM(
                world[inliers], pixels[inliers], self.camera.matrix, None, rotation, translation
            )
            pose = _camera_pose(cv2.Rodrigues(rotation)[0], translation)
            error = self._reprojection(pose, world, pixels)
            inliers = np.flatnonzero(error < self.settings.inlier_error)
            if len(inliers) < 6:
                return None, error
        return pose, error

    def _reprojection(self, pose: Array, world: Array, pixels: Array) -> Array:
        """Return the distances (n,) between pixels (n, 2) and the projections of points (n, 3) [px]."""
        local = transform_points(invert_pose(pose), world)
        depth = np.where(local[:, 2] > 1e-6, local[:, 2], np.nan)
        projected = local @ self.camera.matrix.T / depth[:, None]
        return np.nan_to_num(np.linalg.norm(projected[:, :2] - pixels, axis=1), nan=1e3)

    def _spread(self, pose: Array, world: Array, error: Array) -> float:
        """Return the standard deviation of the camera position, from the Jacobian of the reprojection."""
        local = transform_points(invert_pose(pose), world)
        jacobian = projection_jacobian(local, self.camera.focal_length).reshape(-1, 6)
        covariance = np.linalg.pinv(jacobian.T @ jacobian) * np.mean(error**2) / 2
        return float(np.sqrt(np.trace(covariance[:3, :3])))

    def _is_new(self, frame: TrackedFrame) -> bool:
        """Return whether the view is good enough for a keyframe and shows enough that the others do not."""
        if frame.inliers < self.settings.keyframe_inliers:
            return False
        distances = [np.linalg.norm(keyframe.pose[:3, 3] - frame.pose[:3, 3]) for keyframe in self.keyframes]
        nearest = int(np.argmin(distances))
        known = np.count_nonzero(self.keyframes[nearest].points >= 0)
        fewer = frame.inliers < self.settings.keyframe_share * known
        return bool(distances[nearest] > self.settings.keyframe_distance / (3 if fewer else 1))

    def _add_keyframe(self, pose: Array, features: Features, owner: Indices) -> None:
        """Keep a view: sharpen the points it saw, and triangulate new ones with the nearest keyframes."""
        new = Keyframe(pose, features, owner)
        distances = [np.linalg.norm(keyframe.pose[:3, 3] - pose[:3, 3]) for keyframe in self.keyframes]
        for index in np.argsort(distances, kind="stable")[:4]:
            self._triangulate(new, self.keyframes[index])
        self.keyframes.append(new)
        self._adjust()

    def _adjust(self) -> None:
        """Adjust the newest keyframe, those that share most points with it, and what they saw."""
        newest = np.unique(self.keyframes[-1].points)
        shared = [np.isin(keyframe.points, newest[newest >= 0]).sum() for keyframe in self.keyframes]
        free = np.zeros(len(self.keyframes), dtype=bool)
        free[np.argsort(shared, kind="stable")[-self.settings.window :]] = True
        free[0] = False
        counts = [len(keyframe.points) for keyframe in self.keyframes]
        frame = np.repeat(np.arange(len(counts)), counts)
        point = np.concatenate([keyframe.points for keyframe in self.keyframes])
        pixels = np.concatenate([keyframe.features.pixels for keyframe in self.keyframes])
        used = np.isin(point, np.unique(point[free[frame]])) & (point >= 0)
        cameras, frame = np.unique(frame[used], return_inverse=True)
        points, point = np.unique(point[used], return_inverse=True)
        world_in_camera = [invert_pose(self.keyframes[index].pose) for index in cameras]
        rotations, translations, positions = adjust(
            self.camera.matrix,
            Rotation.from_matrix(np.array([pose[:3, :3] for pose in world_in_camera])),
            np.array([pose[:3, 3] for pose in world_in_camera]),
            self.map.positions[points],
            frame,
            point,
            pixels[used],
            free[cameras],
        )
        self.map.positions[points] = positions
        for index, rotation, translation in zip(cameras, rotations.as_matrix(), translations):
            keyframe = self.keyframes[index]
            keyframe.pose[:3, :3], keyframe.pose[:3, 3] = rotation.T, -rotation.T @ translation
            seen = np.flatnonzero(keyframe.points >= 0)
            world = self.map.positions[keyframe.points[seen]]
            error = self._reprojection(keyframe.pose, world, keyframe.features.pixels[seen])
            keyframe.points[seen[error > self.settings.inlier_error]] = -1
        self._pose = self.keyframes[-1].pose.copy()

    def _triangulate(self, new: Keyframe, old: Keyframe) -> None:
        """Add the points that two keyframes see and the map does not have yet."""
        mine, theirs = np.flatnonzero(new.points < 0), np.flatnonzero(old.points < 0)
        if not len(mine) or not len(theirs):
            return
        a, b = match_descriptors(
            Features(new.features.pixels[mine], new.features.descriptors[mine]),
            Features(old.features.pixels[theirs], old.features.descriptors[theirs]),
            self.settings.hamming,
        )
        mine, theirs = mine[a], theirs[b]
        here, there = new.features.pixels[mine], old.features.pixels[theirs]
        positions, angle = self._meet(new.pose, here, old.pose, there)
        error = np.maximum(
            self._reprojection(new.pose, positions, here), self._reprojection(old.pose, positions, there)
        )
        good = (angle > self.settings.parallax) & (error < 0.5 * self.settings.inlier_error)
        mine, theirs = mine[good], theirs[good]
        added = self.map.add(positions[good], new.features.descriptors[mine], new.pose[:3, 3])
        for keyframe, indices in ((new, mine), (old, theirs)):
            keyframe.points[indices] = added

    def _rays(self, pose: Array, pixels: Array) -> Array:
        """Return unit viewing directions (n, 3) in the map's frame of undistorted pixels (n, 2)."""
        flat = (pixels - self.camera.matrix[:2, 2]) / self.camera.focal_length
        rays = np.column_stack([flat, np.ones(len(flat))]) @ pose[:3, :3].T
        return rays / np.linalg.norm(rays, axis=1, keepdims=True)

    def _meet(self, pose: Array, pixels: Array, other: Array, other_pixels: Array) -> tuple[Array, Array]:
        """Return where the rays of two views come closest, (n, 3), and the angles between them (n,) [rad]."""
        rays, others = self._rays(pose, pixels), self._rays(other, other_pixels)
        base = other[:3, 3] - pose[:3, 3]
        cosine = np.einsum("ij,ij->i", rays, others)
        along, across = rays @ base, others @ base
        sine_squared = np.maximum(1 - cosine**2, 1e-12)
        distance = (along - cosine * across) / sine_squared
        other_distance = (cosine * along - across) / sine_squared
        nearest = pose[:3, 3] + distance[:, None] * rays
        other_nearest = other[:3, 3] + other_distance[:, None] * others
        return (nearest + other_nearest) / 2, np.sqrt(sine_squared)


def _camera_pose(rotation: ArrayLike, translation: ArrayLike) -> Array:
    """Return ``camera_in_map`` (4, 4) from the rotation and translation (3, 1) of the map in the camera."""
    world_in_camera = np.eye(4)
    world_in_camera[:3, :3], world_in_camera[:3, 3:] = rotation, translation
    return invert_pose(world_in_camera)


def fit_similarity(measured: ArrayLike, reference: ArrayLike) -> tuple[Array, float, Array]:
    """Fit ``reference = scale * rotation @ measured + translation`` (Wang et al., Eq. (30); Erratum VS-7).

    Parameters
    ----------
    measured : array_like (n, 3)
        Positions in the map [median depth].
    reference : array_like (n, 3)
        The same positions by an external tracker [m].

    Returns
    -------
    rotation : ndarray (3, 3)
    scale : float
        Metres per unit of the map.
    translation : ndarray (3,)
        [m]

    Raises
    ------
    ValueError
        If the shapes differ, there are fewer than three points, or they lie on a line.
    """
    measured = numbers("measured", measured, ("n >= 3", 3))
    reference = numbers("reference", reference, measured.shape)
    centred, target = measured - measured.mean(axis=0), reference - reference.mean(axis=0)
    if np.linalg.matrix_rank(centred, tol=1e-6 * np.linalg.norm(centred)) < 2:
        raise ValueError("positions lie on a line: the rotation about it cannot be found")
    rotation, _ = Rotation.align_vectors(target, centred)
    turned = rotation.apply(centred)
    scale = float(np.sum(target * turned) / np.sum(turned**2))
    return rotation.as_matrix(), scale, reference.mean(axis=0) - scale * rotation.apply(measured.mean(axis=0))
