"""The simulated prototype: perfect without its causes, physical with them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soro_lib.papers.gesture_steering.world.plant import PrototypeRanges, drawn_prototype, pointing_angle
from soro_lib.robots import CableDrivenArm

ARM = CableDrivenArm()
COMMAND = np.array([0.02, -0.5, -1.0, -0.3, -0.2, -0.7, -0.4])
commands = st.builds(
    lambda slide, cables: np.array([slide, *cables]),
    st.floats(0.0, 0.06),
    st.lists(st.floats(-1.8, -0.05), min_size=6, max_size=6),
)


def rng(seed=0):
    return np.random.default_rng(seed)


@settings(max_examples=25, deadline=None)
@given(commands)
@pytest.mark.parametrize("by_length", [False, True])
def test_perfect_prototype_is_the_model(by_length, command):
    points, direction = drawn_prototype(ARM, None).points(command, by_length)
    pose = ARM.forward(command)
    np.testing.assert_allclose(
        points[0], [[0, 0, command[0]], ARM.mid_point(command), pose[:3, 3]], atol=1e-11
    )
    np.testing.assert_allclose(direction[0], pose[:3, 2], atol=1e-9)


def test_same_seed_same_prototypes():
    first, second = (drawn_prototype(ARM, rng(3), 5).points(COMMAND)[0] for _ in range(2))
    np.testing.assert_array_equal(first, second)


def test_stiffness_alone_moves_the_force_controlled_arm_only():
    """Wound to lengths, a taut arm has its shape from geometry, whatever its stiffness."""
    ranges = PrototypeRanges().only("bending_rigidity", "axial_rigidity")
    prototype = drawn_prototype(ARM, rng(), 20, ranges)
    by_force, by_length = (prototype.points(COMMAND, flag)[0][:, 2] for flag in (False, True))
    tip = ARM.tip(COMMAND)
    assert np.linalg.norm(by_force - tip, axis=1).max() > 1e-4
    np.testing.assert_allclose(by_length, np.tile(tip, (20, 1)), atol=1e-9)


def test_wound_cables_have_their_length_or_are_slack():
    ranges = PrototypeRanges(length_zero_sd=0.5e-3)
    prototype = drawn_prototype(ARM, rng(1), 50, ranges)
    tension = prototype._tension_from_length(COMMAND)
    wound = drawn_prototype(ARM, None)._cable_lengths(-COMMAND[None, 1:]) + prototype.length_zero
    spare = wound - prototype._cable_lengths(tension)
    assert (tension >= 0).all()
    assert (spare > -1e-9).all()
    assert np.abs(np.minimum(tension, 300 * spare)).max() < 1e-7
    assert (tension == 0).any()


def test_friction_loses_tension_when_pulling_and_keeps_it_when_releasing():
    prototype = drawn_prototype(ARM, rng(), 5, PrototypeRanges().only("friction"))
    pulled, released = (prototype._tension_from_force(COMMAND, branch) for branch in (1.0, -1.0))
    assert (pulled < -COMMAND[1:]).all()
    assert (released > -COMMAND[1:]).all()
    np.testing.assert_allclose(pulled * released, np.tile(COMMAND[1:] ** 2, (5, 1)))
    straight = np.array([0.02, *[-0.3] * 6])
    np.testing.assert_allclose(prototype._tension_from_force(straight, 1.0), 0.3)


def test_depth_is_rounded_to_the_resolution_of_the_camera():
    prototype = drawn_prototype(ARM, rng(), 4)
    seen = prototype.measured(prototype.points(COMMAND)[0], rng(1))
    np.testing.assert_allclose(seen[..., 1] * 1e3, np.round(seen[..., 1] * 1e3), atol=1e-9)
    assert np.ptp(seen[..., 0]) > 0


def test_base_lean_turns_about_the_base():
    prototype = drawn_prototype(ARM, rng(), 6, PrototypeRanges().only("base_lean_sd"))
    points, _ = prototype.points(np.array([0.05, *[-0.02] * 6]))
    np.testing.assert_allclose(points[:, 0], [[0, 0, 0.05]] * 6)
    length = np.linalg.norm(points[:, 2] - points[:, 0], axis=1)
    np.testing.assert_allclose(length, length[0])


def test_pointing_angle():
    assert pointing_angle([0, 0, 0], [0.01, 0, 0.01]) == pytest.approx(np.pi / 4)
    np.testing.assert_allclose(pointing_angle(np.zeros((2, 3)), [[0, 0, 1], [0, 0.1, 0]]), [0.0, np.pi / 2])


@pytest.mark.parametrize("bad", [{"friction": (0.2, 0.1)}, {"camera_sd": -1.0}, {"base_lean_sd": np.nan}])
def test_bad_ranges_are_named(bad):
    with pytest.raises(ValueError, match=rf"PrototypeRanges\.{next(iter(bad))}"):
        PrototypeRanges(**bad)


def test_caps_and_no_sessions_are_refused():
    with pytest.raises(ValueError, match="cap_length"):
        drawn_prototype(CableDrivenArm(cap_length=1e-3), rng())
    with pytest.raises(ValueError, match="sessions = 0"):
        drawn_prototype(ARM, rng(), 0)
