"""What all four arms share: Jacobians against differences, batches against single calls, limits."""

import warnings

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from soro_lib.arcs import chain_transform
from soro_lib.robots import ActuationError, CableDrivenArm, HelixArm, PneumaticArm, Robot, SoftGrowingArm

ARMS = {
    "cable_driven": CableDrivenArm(),
    "cable_driven_with_caps": CableDrivenArm(cap_length=0.003, coupling_sign=1),
    "soft_growing": SoftGrowingArm(),
    "pneumatic": PneumaticArm(),
    "helix": HelixArm(),
}
arms = pytest.mark.parametrize("arm", ARMS.values(), ids=ARMS.keys())


@pytest.fixture(autouse=True)
def corners_are_welcome():
    """Points of the box beyond the Helix's round limits are evaluated with a warning, tested elsewhere."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        yield


def inside(arm, share):
    """Return the actuation at a share, in [0, 1], of every actuator's range."""
    return arm.lower + np.asarray(share) * (arm.upper - arm.lower)


def difference_jacobian(arm, actuation):
    """Return the tip Jacobian (6, n) by central differences, in steps of a part of each actuator's range."""
    pose, columns = arm.forward(actuation), []
    for index, step in enumerate(1e-6 * (arm.upper - arm.lower)):
        nudge = np.zeros_like(actuation)
        nudge[index] = step
        slope = (arm.forward(actuation + nudge) - arm.forward(actuation - nudge)) / (2 * step)
        spin = slope[:3, :3] @ pose[:3, :3].T
        columns.append([*slope[:3, 3], spin[2, 1], spin[0, 2], spin[1, 0]])
    return np.stack(columns, axis=-1)


@arms
def test_jacobian_agrees_with_differences(arm):
    rng = np.random.default_rng(1)
    for share in rng.uniform(0.25, 0.75, (20, len(arm.home))):
        actuation = inside(arm, share)
        expected = difference_jacobian(arm, actuation)
        scale = np.abs(expected).max()
        np.testing.assert_allclose(arm.jacobian(actuation), expected, rtol=0, atol=3e-8 * scale)


@arms
def test_home_is_straight_and_regular(arm):
    pose = arm.forward(arm.home)
    np.testing.assert_allclose(pose[:3, :3], np.eye(3), rtol=0, atol=1e-15)
    np.testing.assert_allclose(pose[:2, 3], 0.0, rtol=0, atol=1e-15)
    assert np.isfinite(arm.jacobian(arm.home)).all()
    assert ((arm.lower <= arm.home) & (arm.home <= arm.upper)).all()


@arms
def test_batch_and_single_calls_agree(arm):
    rng = np.random.default_rng(3)
    actuations = inside(arm, rng.uniform(0.0, 1.0, (3, 4, len(arm.home))))
    poses, jacobians = arm.forward(actuations), arm.jacobian(actuations)
    assert poses.shape == (3, 4, 4, 4)
    assert jacobians.shape == (3, 4, 6, len(arm.home))
    scale = np.abs(jacobians).max()
    for index in np.ndindex(3, 4):
        np.testing.assert_allclose(arm.forward(actuations[index]), poses[index], rtol=0, atol=1e-13)
        np.testing.assert_allclose(
            arm.jacobian(actuations[index]), jacobians[index], rtol=0, atol=1e-13 * scale
        )
    assert arm.forward(actuations[:0]).shape == (0, 4, 4, 4)


@arms
def test_forward_is_the_chain_of_the_configuration(arm):
    actuation = inside(arm, np.full(len(arm.home), 0.3))
    np.testing.assert_array_equal(arm.forward(actuation), chain_transform(arm.configuration(actuation)))
    np.testing.assert_array_equal(arm.tip(actuation), arm.forward(actuation)[:3, 3])
    np.testing.assert_allclose(arm.backbone(actuation, 5)[-1], arm.tip(actuation), rtol=0, atol=1e-14)


@arms
def test_every_actuator_is_refused_beyond_its_limits_by_name(arm):
    for index, name in enumerate(arm.actuator_names):
        for bound, sign in ((arm.lower, -1.0), (arm.upper, 1.0)):
            actuation = arm.home.copy()
            actuation[index] = bound[index]
            arm.forward(actuation)
            actuation[index] += sign * 1e-3
            message = (
                rf"actuation\[{index}\] \({name.replace('[', '.').replace(']', '.')}\) is .*, outside \["
            )
            for method in (arm.forward, arm.jacobian, arm.configuration, arm.tip, arm.backbone):
                with pytest.raises(ActuationError, match=message):
                    method(actuation)


@arms
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_values_that_are_not_finite_are_refused(arm, value):
    actuation = np.tile(arm.home, (2, 1))
    actuation[1, -1] = value
    last = len(arm.home) - 1
    with pytest.raises(ActuationError, match=rf"actuation\[{last}\] .* is (nan|inf|-inf), outside"):
        arm.forward(actuation)
    with pytest.raises(ActuationError, match=rf"actuation must be finite, got .* at index \(1, {last}\)"):
        arm.clip(actuation)


@arms
@pytest.mark.parametrize("malformed", [0.1, [0.1, 0.2], np.zeros((2, 20)), "slide", [None, "a", 3]])
def test_wrong_shapes_are_refused(arm, malformed):
    with pytest.raises(ActuationError, match=rf"actuation must .*shape \(\.\.\., {len(arm.home)}\)"):
        arm.forward(malformed)


@pytest.mark.parametrize("name", ARMS)
@given(data=st.data())
def test_clipping_reports_every_change_and_is_admissible(name, data):
    arm = ARMS[name]
    share = data.draw(st.lists(st.floats(-3.0, 4.0), min_size=len(arm.home), max_size=len(arm.home)))
    requested = inside(arm, share)
    report = arm.clip(requested)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        arm.forward(report.actuation)
    np.testing.assert_allclose(report.actuation + report.excess, requested, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(report.clipped, report.excess != 0.0)
    assert report.any_clipped == report.clipped.any()
    again = arm.clip(report.actuation)
    np.testing.assert_allclose(again.actuation, report.actuation, rtol=0, atol=1e-15)


@arms
def test_an_admissible_actuation_is_left_alone(arm):
    report = arm.clip(arm.home)
    assert not report.any_clipped
    np.testing.assert_array_equal(report.actuation, arm.home)


@arms
def test_every_arm_offers_the_interface_of_the_controllers(arm):
    assert isinstance(arm, Robot)
    assert len(arm.actuator_names) == len(arm.lower) == len(arm.upper) == len(arm.home)
    assert arm.configuration_jacobian(arm.home).shape == (arm.configuration(arm.home).size, len(arm.home))
