"""Signs of quaternions against SciPy's rotations."""

import numpy as np
from scipy.spatial.transform import Rotation

from soro_lib.poses import align_quaternion


def test_aligned_quaternions_are_the_same_rotations_in_one_hemisphere():
    quaternions = Rotation.random(50, np.random.default_rng(1)).as_quat()
    aligned = align_quaternion(quaternions, quaternions[0])
    assert (aligned @ quaternions[0] >= 0.0).all()
    apart = (Rotation.from_quat(aligned) * Rotation.from_quat(quaternions).inv()).magnitude()
    np.testing.assert_allclose(apart, 0.0, rtol=0, atol=1e-14)
