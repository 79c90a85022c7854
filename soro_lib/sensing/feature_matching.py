"""ORB features of an image, spread over it, and two ways to match them: anywhere, or near a prediction."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from soro_lib.sensing.rendering import Camera

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


@dataclass(frozen=True)
class Features:
    """Features of one image: undistorted pixels (n, 2) and binary descriptors (n, 32) uint8."""

    pixels: Array
    descriptors: NDArray[np.uint8]

    def __len__(self) -> int:
        return len(self.pixels)


class FeatureDetector:
    """Detects the strongest ORB features of every part of an image.

    Parameters
    ----------
    camera : Camera
        Calibrated camera; its distortion is removed from the pixels.
    count : int
        Most features per image.
    cells : int
        Cells along the longer side; the strongest features of each are taken in turn.
    levels : int
        Levels of the image pyramid, a factor 1.2 apart.
    corner_threshold : int
        Threshold of the FAST corner test [grey levels].
    """

    def __init__(self, camera: Camera, count: int, cells: int, levels: int, corner_threshold: int) -> None:
        self.camera, self.count, self.cells = camera, count, cells
        self._orb = cv2.ORB.create(4 * count, scaleFactor=1.2, nlevels=levels, fastThreshold=corner_threshold)

    def detect(self, image: NDArray[np.uint8] | None) -> Features:
        """Return the features of an image (height, width[, 3]); none for None.

        Raises
        ------
        ValueError
            If the image has the wrong size or type.
        """
        if image is None:
            return Features(np.zeros((0, 2)), np.zeros((0, 32), dtype=np.uint8))
        self._check(image)
        if image.ndim == 3:
            image = np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), dtype=np.uint8)
        keypoints, descriptors = self._orb.compute(image, self._spread_out(self._orb.detect(image)))
        if descriptors is None:
            return self.detect(None)
        pixels = np.array(cv2.KeyPoint.convert(keypoints), dtype=float)
        if self.camera.distortion:
            pixels = (self.camera.rays(pixels) @ self.camera.matrix.T)[:, :2]
        return Features(pixels, np.asarray(descriptors, dtype=np.uint8))

    def _check(self, image: object) -> None:
        size = (self.camera.height, self.camera.width)
        if not isinstance(image, np.ndarray):
            raise ValueError(
                f"image must be uint8 of shape {size} or {(*size, 3)}, got {type(image).__name__}"
            )
        if image.dtype != np.uint8 or image.shape not in (size, (*size, 3)):
            raise ValueError(
                f"image must be uint8 of shape {size} or {(*size, 3)}, got {image.dtype} {image.shape}"
            )

    def _spread_out(self, keypoints: Sequence[cv2.KeyPoint]) -> list[cv2.KeyPoint]:
        """Return the strongest keypoints of every cell, so that no corner of the image holds them all."""
        if not keypoints:
            return []
        size = max(self.camera.width, self.camera.height) / self.cells
        cell = (np.array(cv2.KeyPoint.convert(keypoints)) / size).astype(int)
        index = cell[:, 0] + self.cells * cell[:, 1]
        order = np.lexsort(([-keypoint.response for keypoint in keypoints], index))
        starts = np.flatnonzero(np.diff(index[order], prepend=-1))
        rank = np.arange(len(order)) - np.repeat(starts, np.diff(starts, append=len(order)))
        best = order[np.argsort(rank, kind="stable")]
        return [keypoints[k] for k in best[: self.count]]


def match_descriptors(first: Features, second: Features, hamming: int) -> tuple[Indices, Indices]:
    """Return the indices of features that are each other's best match, wherever they are.

    Parameters
    ----------
    first, second : Features
        What to match.
    hamming : int
        Matches must differ in fewer of the 256 bits.
    """
    if len(first) < 2 or len(second) < 2:
        return np.zeros(0, dtype=np.intp), np.zeros(0, dtype=np.intp)
    matches = cv2.BFMatcher(cv2.NORM_HAMMING, crossCheck=True).match(first.descriptors, second.descriptors)
    pairs = np.array([(match.queryIdx, match.trainIdx) for match in matches if match.distance < hamming])
    pairs = pairs.reshape(-1, 2).astype(np.intp)
    return pairs[:, 0], pairs[:, 1]


def match_near(
    expected: Array,
    descriptors: NDArray[np.uint8],
    features: Features,
    gate: float,
    hamming: int,
    ratio: float,
) -> tuple[Indices, Indices]:
    """Match map points to features near their expected pixels.

    Parameters
    ----------
    expected : ndarray (n, 2)
        Where the points are expected [px].
    descriptors : ndarray (n, 32)
        Their descriptors, uint8.
    features : Features
        Features of the image.
    gate : float
        Search radius [px].
    hamming : int
        Matches must differ in fewer of the 256 bits.
    ratio : float
        The best match must have less than this part of the bits of the second best.

    Returns
    -------
    points, features : ndarray (m,) of int
        Indices of the matches; every feature at most once.
    """
    nothing = np.zeros(0, dtype=np.intp)
    if not len(expected) or not len(features):
        return nothing, nothing
    pairs = cKDTree(expected).sparse_distance_matrix(cKDTree(features.pixels), gate, output_type="ndarray")
    point, feature = pairs["i"], pairs["j"]
    mine = np.ascontiguousarray(descriptors).view(np.uint64)[point]
    theirs = np.ascontiguousarray(features.descriptors).view(np.uint64)[feature]
    bits = np.bitwise_count(mine ^ theirs).sum(axis=1, dtype=np.int32)
    order = np.lexsort((bits, point))
    point, feature, bits = point[order], feature[order], bits[order]
    first = np.flatnonzero(np.diff(point, prepend=-1))
    second = np.minimum(first + 1, len(point) - 1)
    rival = np.where((second > first) & (point[second] == point[first]), bits[second], 256)
    good = first[(bits[first] < hamming) & (bits[first] < ratio * rival)]
    good = good[np.argsort(bits[good], kind="stable")]
    _, unique = np.unique(feature[good], return_index=True)
    good = good[unique]
    return point[good], feature[good]
