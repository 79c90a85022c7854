"""The mapping of hand to tip, and the errata of its equations."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from soro_lib.controllers.gestures import Gesture
from soro_lib.controllers.hand_mapping import PalmMapping, TipGoal, constrained_goal, limited_tilt

coordinate = st.floats(-0.3, 0.3)
directions = st.tuples(st.floats(0, math.pi), st.floats(-math.pi, math.pi)).map(
    lambda a: (math.sin(a[0]) * math.cos(a[1]), math.sin(a[0]) * math.sin(a[1]), math.cos(a[0]))
)


def test_scaling_matrix_acts_per_axis():
    """Erratum GS-5: as a translation the printed c puts the tip at 200.55 mm for a palm 200 mm high."""
    height = 200.0
    as_translation = height + (150 / height - 0.2)
    assert as_translation == pytest.approx(200.55)
    per_axis = (150 / height - 0.2) * height
    assert PalmMapping().position((0.05, 0.2, -0.03)) == pytest.approx((0.010, 0.006, per_axis * 1e-3))
    assert per_axis == pytest.approx(110.0)


def test_printed_scale_puts_fig7b_outside_the_box():
    """Erratum GS-6: with the printed offset and c_z the 140 mm of Fig. 7(b) need a palm below the box."""
    printed, lowered = PalmMapping(), PalmMapping(offset=0.165)
    palm = printed.palm((-0.015, -0.020, 0.140))
    assert palm[1] == pytest.approx(0.050)
    assert not printed.in_box(palm)
    assert lowered.in_box(lowered.palm((-0.015, -0.020, 0.140)))


def test_normal_goes_through_the_same_permutation():
    """Erratum GS-7: with the identity of (4) a flat palm asks for a tip that points sideways."""
    flat = (0.0, -1.0, 0.0)
    assert PalmMapping().direction(flat) == (0.0, 0.0, 1.0)
    assert flat[2] == 0.0  # what the printed identity block would pass on as the tip's direction
    mapping = PalmMapping()
    forward = Rotation.from_rotvec([0.2, 0, 0]).apply(flat)  # the palm leans towards the user
    moved = np.subtract(mapping.position((0.0, 0.2, 0.1)), mapping.position((0.0, 0.2, 0.0)))
    assert math.copysign(1, mapping.direction(tuple(forward))[1]) == math.copysign(1, -forward[2])
    assert moved[1] < 0  # a hand moved towards the user moves the tip towards -y


def test_palm_normal_is_no_euler_triple():
    """Erratum GS-8: read as three angles in rad, the normal of a flat palm is a pitch of one radian."""
    flat = np.array([0.0, -1.0, 0.0])
    as_euler = Rotation.from_euler("ZYX", flat).apply([0.0, 0.0, 1.0])
    assert np.degrees(np.arccos(as_euler[2])) == pytest.approx(57.3, abs=0.1)
    assert PalmMapping().direction(tuple(flat)) == (0.0, 0.0, 1.0)


def test_printed_gesture_matrices_do_not_constrain():
    """Erratum GS-13: multiplied out, the printed matrices of (20) keep x and y; the text does not."""
    palm = np.eye(4)
    palm[:3, :3] = Rotation.from_rotvec([0.3, 0.1, 0.0]).as_matrix()
    palm[:3, 3] = (30.0, 20.0, 110.0)
    v_sign, thumbs_up, plain = np.eye(4), np.eye(4), np.eye(4)
    thumbs_up[:3, :3] = palm[:3, :3].T
    plain[:3, 3] = 1.0
    assert (v_sign @ palm)[0, 3] == 30.0
    assert abs((thumbs_up @ palm)[0, 3]) > 1.0
    np.testing.assert_allclose((plain @ palm)[:3, 3], (31.0, 21.0, 111.0))

    goal = TipGoal((0.03, 0.02, 0.11), (0.3, 0.0, math.sqrt(0.91)))
    assert constrained_goal(Gesture.V_SIGN, goal) == TipGoal((0.0, 0.0, 0.11), goal.direction)
    assert constrained_goal(Gesture.THUMBS_UP, goal) == TipGoal((0.0, 0.0, 0.11), (0.0, 0.0, 1.0))
    assert constrained_goal(Gesture.PALM, goal) == constrained_goal(Gesture.FIST, goal) == goal


@given(st.tuples(coordinate, st.floats(0.1, 0.4), coordinate))
def test_mapping_can_be_inverted(palm):
    mapping = PalmMapping()
    assert mapping.palm(mapping.position(palm)) == pytest.approx(palm, abs=1e-12)


@given(directions)
def test_direction_and_normal_are_inverse(direction):
    mapping = PalmMapping()
    assert mapping.direction(mapping.normal(direction)) == direction


@given(directions, st.floats(0.05, 1.5))
def test_limited_tilt_is_limited_unit_and_keeps_the_azimuth(direction, limit):
    x, y, z = limited_tilt(direction, limit)
    assert math.hypot(x, y, z) == pytest.approx(1.0)
    assert math.atan2(math.hypot(x, y), z) <= limit + 1e-9
    if math.hypot(*direction[:2]) > 1e-6:
        assert x * direction[1] - y * direction[0] == pytest.approx(0.0, abs=1e-9)
        assert x * direction[0] + y * direction[1] >= 0


def test_reach_aware_limit_shrinks_beside_the_axis():
    mapping = PalmMapping(maximum_tilt=math.radians(40), tilt_loss=math.radians(40) / 0.04)
    assert mapping.tilt_limit((0.0, 0.0, 0.12)) == pytest.approx(math.radians(40))
    assert mapping.tilt_limit((0.03, 0.0, 0.12)) == pytest.approx(math.radians(10))
    assert mapping.tilt_limit((0.05, 0.0, 0.12)) == 0.0


@pytest.mark.parametrize(
    ("palm", "inside"),
    [
        ((0, 0.1, 0), True),
        ((0, 0.4, 0), True),
        ((0, 0.099, 0), False),
        ((0.151, 0.2, 0), False),
        ((0, 0.2, -0.2), False),
    ],
)
def test_box(palm, inside):
    assert PalmMapping().in_box(palm) is inside


@pytest.mark.parametrize(
    "bad",
    [{"scale_x": math.nan}, {"lowest": 0.5}, {"half_width": 0.0}, {"maximum_tilt": 2.0}, {"tilt_loss": -1.0}],
)
def test_bad_parameters_are_named(bad):
    with pytest.raises(ValueError, match=next(iter(bad))):
        PalmMapping(**bad)
