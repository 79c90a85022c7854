"""The three-chamber arm of Wang et al. and the errata of its Eqs. (19)-(22)."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.optimize import brentq

from soro_lib.robots import PneumaticArm
from soro_lib.robots.pneumatic import CHAMBER_ANGLES

ARM = PneumaticArm()
lengths = st.lists(st.floats(0.06, 0.14), min_size=3, max_size=3).map(np.array)


def delta(chambers):
    """Return delta of Eq. (21), as printed."""
    l1, l2, l3 = chambers
    return np.sqrt(max(l1**2 + l2**2 + l3**2 - l1 * l2 - l1 * l3 - l2 * l3, 0.0))


def position_of_equation_22(radius, theta, phi):
    """Return the position of Eq. (22), as printed."""
    lateral = radius * (1 - np.cos(theta))
    return np.array([lateral * np.cos(phi), lateral * np.sin(phi), radius * np.sin(theta)])


@given(lengths)
def test_corrected_equations_19_to_22_are_the_tip(chambers):
    """With a four-quadrant arctangent the printed parameters give the tip, wherever they are defined."""
    l1, l2, l3 = chambers
    assume(delta(chambers) > 1e-4)
    phi = np.arctan2(np.sqrt(3) * (l2 + l3 - 2 * l1), 3 * (l2 - l3))
    theta = 2 * delta(chambers) / (3 * ARM.chamber_distance)
    radius = ARM.chamber_distance * chambers.sum() / (2 * delta(chambers))
    printed = position_of_equation_22(radius, theta, phi)
    np.testing.assert_allclose(ARM.tip(chambers), printed, rtol=0, atol=1e-11)
    curvature = (l2 + l3 - 2 * l1) / (chambers.sum() * ARM.chamber_distance * np.sin(phi))
    if abs(np.sin(phi)) > 1e-3:
        assert curvature * chambers.mean() == pytest.approx(theta, rel=1e-7)


@pytest.mark.parametrize("longer", [1, 2])
def test_printed_equation_19_folds_half_of_the_plane(longer):
    """Erratum: a plain arctangent with delta > 0 sends a bend toward -x to +x."""
    chambers = np.full(3, 0.09)
    chambers[longer] += 0.01
    l1, l2, l3 = chambers
    phi = np.arctan(np.sqrt(3) * (l2 + l3 - 2 * l1) / (3 * (l2 - l3)))
    theta = 2 * delta(chambers) / (3 * ARM.chamber_distance)
    printed = position_of_equation_22(chambers.mean() / theta, theta, phi)
    agrees = np.allclose(printed, ARM.tip(chambers), rtol=0, atol=1e-9)
    assert agrees == (longer == 1)


def test_printed_equations_20_and_21_have_no_value_at_the_straight_arm():
    """Erratum: 0/0 (and at phi = 0 even when bent); the bending components are regular."""
    with np.errstate(divide="ignore", invalid="ignore"):
        assert np.isnan(np.float64(0.0) / (3 * 0.09 * ARM.chamber_distance * np.sin(0.0)))
        assert np.isinf(ARM.chamber_distance * np.float64(0.27) / (2 * delta([0.09, 0.09, 0.09])))
    np.testing.assert_allclose(ARM.configuration(ARM.home), [[0.0, 0.0, 0.09]], rtol=0, atol=1e-16)
    toward_x = np.array([0.09, 0.095, 0.085])
    assert toward_x[1] + toward_x[2] - 2 * toward_x[0] == pytest.approx(0.0, abs=1e-17)
    assert ARM.tip(toward_x)[0] > 0.01


def test_jacobian_at_the_straight_arm_needs_no_offset():
    """Section III-A adds 1e-5 to the lengths; the limit is l / (3 d) times the slopes of the bend vector."""
    slopes = np.array([[0.0, np.sqrt(0.75), -np.sqrt(0.75)], [-1.0, 0.5, 0.5]])
    expected = ARM.rest_length / (3 * ARM.chamber_distance) * slopes
    np.testing.assert_allclose(ARM.jacobian(ARM.home)[:2], expected, rtol=1e-14)


def test_common_elongation_is_the_null_space_of_the_straight_arm():
    np.testing.assert_allclose(ARM.jacobian(ARM.home)[:2] @ np.ones(3), 0.0, rtol=0, atol=1e-14)


def test_true_singularity_is_where_the_tip_turns_back():
    """The lateral reach (1 - cos theta) / theta has its maximum at 2.33 rad."""
    theta = brentq(lambda t: t * np.sin(t) - (1 - np.cos(t)), 2.0, 3.0)
    assert theta == pytest.approx(2.33, abs=5e-3)
    for bend, sign in ((theta - 0.05, 1.0), (theta + 0.05, -1.0)):
        chambers = ARM.chamber_lengths([[bend, 0.0, 0.09]])
        outward = ARM.jacobian(chambers)[0] @ (ARM.chamber_lengths([[1.0, 0.0, 0.0]]))
        assert np.sign(outward) == sign


@given(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.floats(0.08, 0.1))
def test_chamber_lengths_invert_the_configuration(dx, dy, length):
    arc = np.array([[dx, dy, length]])
    np.testing.assert_allclose(ARM.configuration(ARM.chamber_lengths(arc)), arc, rtol=0, atol=1e-13)


@pytest.mark.parametrize("chamber", [0, 1, 2])
def test_arm_bends_away_from_the_longest_chamber(chamber):
    lengthened = ARM.home.copy()
    lengthened[chamber] += 0.005
    lateral = ARM.tip(lengthened)[:2]
    away = -np.array([np.cos(CHAMBER_ANGLES[chamber]), np.sin(CHAMBER_ANGLES[chamber])])
    np.testing.assert_allclose(lateral / np.linalg.norm(lateral), away, rtol=0, atol=1e-12)


def test_displacement_is_relative_to_the_tip_at_rest():
    """Erratum: Eq. (22) measures z from the base, Section II-A puts the origin at the tip."""
    np.testing.assert_allclose(ARM.displacement(ARM.home), 0.0, rtol=0, atol=1e-16)
    np.testing.assert_allclose(ARM.displacement(ARM.home + 0.01), [0.0, 0.0, 0.01], rtol=0, atol=1e-16)


def test_motor_commands_scale_the_elongations():
    arm = PneumaticArm(motor_gains=(1.0, 2.0, -3.0))
    commands = arm.motor_commands([0.1, 0.1, 0.1])
    np.testing.assert_allclose(commands, [0.01, 0.02, -0.03], rtol=0, atol=1e-16)


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"chamber_distance": 0.0}, "chamber_distance must be a finite number above 0"),
        ({"rest_length": 0.2}, r"rest_length must be in \[0.045, 0.18\], got 0.2"),
        ({"maximum_length": np.nan}, "maximum_length must be a finite number not below 0.045, got nan"),
        ({"motor_gains": (1.0, 0.0, 1.0)}, "motor_gains must be other than 0"),
    ],
)
def test_bad_parameters_are_refused(parameters, message):
    with pytest.raises(ValueError, match=message):
        PneumaticArm(**parameters)


def test_chamber_lengths_refuse_another_shape():
    with pytest.raises(ValueError, match=r"configuration must have shape \(\.\.\., 1, 3\), got \(3,\)"):
        ARM.chamber_lengths([0.0, 0.0, 0.09])
