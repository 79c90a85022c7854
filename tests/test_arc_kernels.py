"""The compiled chain: the same numbers as the functions it is compiled from."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from soro_lib.arc_kernels import chain_frame_and_jacobian, swing
from soro_lib.arcs import chain_transform_and_jacobian

ARC = st.tuples(st.floats(-4.0, 4.0), st.floats(-4.0, 4.0), st.floats(-0.3, 0.3))
CHAIN = st.lists(ARC, min_size=1, max_size=4).map(np.array)
SCALE = st.sampled_from([1.0, 0.1, 1e-3, 1e-9, 0.0])


@given(CHAIN, SCALE)
def test_compiled_chain_equals_the_chain(chain, scale):
    chain = chain * [scale, scale, 1.0]
    frame, jacobian = chain_frame_and_jacobian(chain)
    pose, expected = chain_transform_and_jacobian(chain)
    np.testing.assert_allclose(frame, pose[:3], rtol=0, atol=1e-14)
    np.testing.assert_allclose(jacobian, expected, rtol=0, atol=1e-14)


def test_swing_adds_the_turn_times_the_lever():
    rng = np.random.default_rng(1)
    velocities, lever = rng.normal(size=(6, 5)), rng.normal(size=3)
    expected = velocities.copy()
    expected[:3, 1:4] += np.cross(velocities[3:, 1:4].T, lever).T
    swing(velocities, 1, tuple(lever))
    np.testing.assert_allclose(velocities[:3], expected[:3], atol=1e-14)
    np.testing.assert_array_equal(velocities[3:], expected[3:])
    np.testing.assert_array_equal(velocities[:, [0, 4]], expected[:, [0, 4]])
