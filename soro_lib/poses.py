"""Lengths of vectors and signs of quaternions, where neither NumPy nor SciPy does what control loops need.

A pose is a homogeneous transform (4, 4) from the named frame to the base frame; conversions between matrices,
quaternions (scalar last) and rotation vectors are `scipy.spatial.transform.Rotation`'s.
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray


def magnitude(vector: ArrayLike) -> float:
    """Return the length of one vector (n,).

    Not by np.linalg.norm, which asks BLAS: its last bit differs from processor to processor, and in a closed
    loop that is chaotic the last bit decides where it ends.

    Examples
    --------
    >>> magnitude([3.0, 4.0])
    5.0
    """
    return math.hypot(*np.asarray(vector, dtype=float).tolist())


def align_quaternion(quaternion: ArrayLike, reference: ArrayLike) -> NDArray[np.float64]:
    """Return the quaternions, shape (..., 4), or their negatives, whichever is nearer to `reference`.

    q and -q are the same rotation, so blending or filtering quaternions needs them in one hemisphere first.
    """
    turn, near = np.asarray(quaternion, dtype=float), np.asarray(reference, dtype=float)
    return np.where((turn * near).sum(axis=-1, keepdims=True) < 0.0, -turn, turn)
