"""ORB features of an image, spread over it, and two ways to match them: anywhere, or near a prediction."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from operator import attrgetter

import cv2
import numpy as np
from numba import njit
from numpy.typing import NDArray

from soro_lib.sensing.camera import Camera

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
        got = f"{image.dtype} {image.shape}" if isinstance(image, np.ndarray) else type(image).__name__
        if got not in (f"uint8 {size}", f"uint8 {(*size, 3)}"):
            raise ValueError(f"image must be uint8 of shape {size} or {(*size, 3)}, got {got}")

    def _spread_out(self, keypoints: Sequence[cv2.KeyPoint]) -> list[cv2.KeyPoint]:
        """Return the strongest keypoints of every cell, so that no corner of the image holds them all."""
        if not keypoints:
            return []
        size = max(self.camera.width, self.camera.height) / self.cells
        cell = (np.array(cv2.KeyPoint.convert(keypoints)) / size).astype(int)
        index = cell[:, 0] + self.cells * cell[:, 1]
        response = np.fromiter(map(attrgetter("response"), keypoints), dtype=float, count=len(keypoints))
        order = np.lexsort((-response, index))
        starts = np.flatnonzero(np.diff(index[order], prepend=-1))
        rank = np.arange(len(order)) - np.repeat(starts, np.diff(starts, append=len(order)))
        best = order[np.argsort(rank, kind="stable")]
        return [keypoints[k] for k in best[: self.count].tolist()]


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
    if not len(expected) or not len(features):
        return np.zeros(0, dtype=np.intp), np.zeros(0, dtype=np.intp)
    point = _points_of_features(
        np.ascontiguousarray(expected),
        np.ascontiguousarray(descriptors).view(np.uint64),
        np.ascontiguousarray(features.pixels),
        np.ascontiguousarray(features.descriptors).view(np.uint64),
        gate,
        hamming,
        ratio,
    )
    feature = np.flatnonzero(point >= 0)
    return point[feature], feature


@njit(cache=True)
def _points_of_features(
    expected: Array,
    descriptors: NDArray[np.uint64],
    pixels: Array,
    seen: NDArray[np.uint64],
    gate: float,
    hamming: int,
    ratio: float,
) -> Indices:
    """Return the point that each feature matches, or -1, for `match_near`; descriptors as (n, 4) words.

    The features are sorted into cells as wide as the gate, so that a point looks into nine cells only.
    """
    corner_x, corner_y = pixels[:, 0].min(), pixels[:, 1].min()
    columns = int((pixels[:, 0].max() - corner_x) / gate) + 1
    rows = int((pixels[:, 1].max() - corner_y) / gate) + 1
    column = ((pixels[:, 0] - corner_x) / gate).astype(np.intp)
    row = ((pixels[:, 1] - corner_y) / gate).astype(np.intp)
    order = np.argsort(row * columns + column, kind="mergesort")
    start = np.zeros(rows * columns + 1, dtype=np.intp)
    for feature in range(len(pixels)):
        start[row[feature] * columns + column[feature] + 1] += 1
    start = np.cumsum(start)

    point_of = np.full(len(pixels), -1)
    bits_of = np.full(len(pixels), 256)
    for point in range(len(expected)):
        x, y = expected[point]
        middle_column, middle_row = math.floor((x - corner_x) / gate), math.floor((y - corner_y) / gate)
        best, best_bits, rival_bits = -1, 256, 256
        for r in range(max(middle_row - 1, 0), min(middle_row + 2, rows)):
            for c in range(max(middle_column - 1, 0), min(middle_column + 2, columns)):
                cell = r * columns + c
                for feature in order[start[cell] : start[cell + 1]]:
                    if (pixels[feature, 0] - x) ** 2 + (pixels[feature, 1] - y) ** 2 > gate**2:
                        continue
                    bits = _differing_bits(descriptors[point], seen[feature])
                    if bits < best_bits:
                        best, best_bits, rival_bits = feature, bits, best_bits
                    elif bits < rival_bits:
                        rival_bits = bits
        if best_bits < hamming and best_bits < ratio * rival_bits and best_bits < bits_of[best]:
            point_of[best], bits_of[best] = point, best_bits
    return point_of


@njit(cache=True)
def _differing_bits(first: NDArray[np.uint64], second: NDArray[np.uint64]) -> int:
    """Return the number of bits in which two rows of words differ, counted in ever wider fields."""
    total = np.int64(0)
    for k in range(len(first)):
        word = first[k] ^ second[k]
        word -= (word >> np.uint64(1)) & np.uint64(0x5555555555555555)
        pairs = word & np.uint64(0x3333333333333333)
        word = pairs + ((word >> np.uint64(2)) & np.uint64(0x3333333333333333))
        word = (word + (word >> np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
        total += np.int64((word * np.uint64(0x0101010101010101)) >> np.uint64(56))
    return int(total)
