"""Extreme learning machine of Wang et al., Eqs. (1)-(17): batch and recursion, printed and corrected."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soro_lib.estimators.extreme_learning_machine import (
    ExtremeLearningMachine,
    radial_basis,
    same_hemisphere,
    unit_quaternion,
)

GRATINGS = 4


def samples(rng, count):
    """Draw shifts [m] and smooth poses that depend on them."""
    shifts = 5e-11 * rng.uniform(-1.0, 1.0, (count, GRATINGS))
    x = shifts / 5e-11
    poses = np.zeros((count, 7))
    poses[:, 0] = 0.01 * np.sin(x[:, 0]) + 0.004 * x[:, 1] * x[:, 2]
    poses[:, 1] = 0.01 * x[:, 3]
    poses[:, 3] = 0.2 * x[:, 0]
    poses[:, 6] = 1.0
    poses[:, 3:] = unit_quaternion(poses[:, 3:])
    return shifts, poses


def network(seed=0, **options):
    return ExtremeLearningMachine(np.random.default_rng(seed), inputs=GRATINGS, hidden=30, **options)


def weighted_least_squares(hidden, labels, weights, ridge, ridge_weight):
    """Solve the whole weighted problem at once, the definition that the recursion must reproduce."""
    normal = hidden.T @ (weights[:, None] * hidden) + ridge_weight * ridge * np.eye(hidden.shape[1])
    return np.linalg.solve(normal, hidden.T @ (weights[:, None] * labels))


def test_radial_basis_is_equation_3():
    rng = np.random.default_rng(1)
    inputs, centres, widths = rng.normal(size=(5, 3)), rng.normal(size=(7, 3)), rng.uniform(1, 2, 7)
    direct = [[np.exp(-np.sum((x - a) ** 2) / b) for a, b in zip(centres, widths)] for x in inputs]
    assert np.allclose(radial_basis(inputs, centres, widths), direct, rtol=1e-12)


def test_hidden_output_is_equation_3_of_the_scaled_shifts():
    learner = network(input_scale=2e-11)
    shifts, _ = samples(np.random.default_rng(1), 5)
    expected = radial_basis(shifts / 2e-11, learner.centres, learner.widths)
    assert np.allclose(learner.hidden_output(shifts), expected, rtol=1e-12)
    assert np.allclose(learner.hidden_output(shifts[3]), expected[3], rtol=1e-12)


def test_additive_nodes_of_equation_4_are_not_the_radial_ones_of_equation_3():
    """Erratum VS-5: phi(a.x + b) and exp(-|x - a|^2 / b) are different functions of the same parameters."""
    rng = np.random.default_rng(1)
    inputs, centres, widths = rng.normal(size=(5, 3)), rng.normal(size=(7, 3)), rng.uniform(1, 2, 7)
    additive = np.exp(-((inputs @ centres.T + widths) ** 2))
    assert not np.allclose(radial_basis(inputs, centres, widths), additive, atol=0.1)


def test_first_solution_is_the_pseudoinverse_where_that_is_well_conditioned():
    """Eqs. (5)-(7), (9): with a vanishing ridge the regularised solution tends to the Moore-Penrose one."""
    rng = np.random.default_rng(2)
    shifts, poses = samples(rng, 400)
    few = ExtremeLearningMachine(rng, inputs=GRATINGS, hidden=8, regularisation=1e-10)
    few.fit(shifts, poses)
    hidden = few.hidden_output(shifts)
    assert np.linalg.cond(hidden) < 1e5
    exact = hidden @ np.linalg.pinv(hidden) @ poses
    assert np.allclose(hidden @ few.weights, exact, atol=1e-6)


def test_labels_must_be_one_row_per_sample():
    """Erratum VS-6: Z_c as defined is 7 x N0; Phi beta = Z_c needs N0 x 7."""
    shifts, poses = samples(np.random.default_rng(3), 50)
    with pytest.raises(ValueError, match=r"poses must have shape \(50, 7\), got \(7, 50\)"):
        network().fit(shifts, poses.T)


def test_more_samples_than_nodes_do_not_make_the_normal_matrix_invertible():
    """Erratum VS-7: N0 = 450 > N = 200 is necessary for Eq. (9), not sufficient."""
    rng = np.random.default_rng(4)
    along_a_line = np.linspace(0.0, 5e-11, 450)[:, None] * rng.uniform(-1, 1, GRATINGS)
    full = ExtremeLearningMachine(rng, inputs=GRATINGS, hidden=200)
    hidden = full.hidden_output(along_a_line)
    assert np.linalg.cond(hidden.T @ hidden) > 1e14
    poses = np.tile([0.0, 0, 0, 0, 0, 0, 1], (450, 1))
    full.fit(along_a_line, poses)
    assert np.allclose(full.predict(along_a_line), poses, atol=1e-5)


def test_singular_normal_matrix_is_refused_with_its_condition():
    shifts = np.zeros((450, GRATINGS))
    poses = np.tile([0.0, 0, 0, 0, 0, 0, 1], (450, 1))
    with pytest.raises(ValueError, match="raise regularisation"):
        ExtremeLearningMachine(np.random.default_rng(0), inputs=GRATINGS, regularisation=1e-16).fit(
            shifts, poses
        )


@pytest.mark.parametrize("forgetting", [1.0, 0.99])
def test_recursion_is_cumulative_weighted_least_squares(forgetting):
    """Eqs. (10)-(17) corrected: after k updates every old sample weighs w^(age), and so does the ridge."""
    rng = np.random.default_rng(5)
    shifts, poses = samples(rng, 160)
    learner = network(forgetting=forgetting, regularisation=1e-3, maximum_trace=np.inf)
    learner.fit(shifts[:100], poses[:100])
    for shift, pose in zip(shifts[100:], poses[100:]):
        assert learner.update(shift, pose).accepted
    age = np.concatenate([np.full(100, 60), np.arange(59, -1, -1)])
    expected = weighted_least_squares(
        learner.hidden_output(shifts), poses, forgetting**age, 1e-3, forgetting**60
    )
    assert np.allclose(learner.weights, expected, atol=1e-7)


def test_equations_12_to_16_as_printed_forget_everything_but_two_samples():
    """Erratum VS-3: from the batches k and k-1 alone H has rank 2 for single samples, so no inverse."""
    shifts, _ = samples(np.random.default_rng(6), 2)
    hidden = network().hidden_output(shifts)
    printed = np.outer(hidden[1], hidden[1]) + 0.99 * np.outer(hidden[0], hidden[0])
    assert np.linalg.matrix_rank(printed) == 2 < printed.shape[0]


def test_gain_matrix_of_equation_11_needs_the_forgetting_factor():
    """Erratum VS-3: K_k = Phi' Phi + w K_(k-1); without w the old samples keep their weight."""
    rng = np.random.default_rng(7)
    shifts, poses = samples(rng, 60)
    learner = network(forgetting=0.9, regularisation=1e-2, maximum_trace=np.inf)
    learner.fit(shifts[:59], poses[:59])
    before = np.linalg.inv(learner.covariance)
    row = learner.hidden_output(shifts[59])
    learner.update(shifts[59], poses[59])
    after = np.linalg.inv(learner.covariance)
    assert np.allclose(after, 0.9 * before + np.outer(row, row), rtol=1e-6)
    assert not np.allclose(after, before + np.outer(row, row), rtol=1e-3)


def test_equation_17_as_printed_does_not_conform():
    """Erratum VS-2: Phi is 1 x N and M is N x 7, so Phi (Phi M) has no meaning; Phi (H Phi') has."""
    learner = network()
    shifts, poses = samples(np.random.default_rng(8), 40)
    learner.fit(shifts, poses)
    phi = learner.hidden_output(shifts[:1])
    moment = learner.hidden_output(shifts).T @ poses
    with pytest.raises(ValueError, match="mismatch"):
        phi @ (phi @ moment)
    direction = learner.covariance @ phi.T
    assert (phi @ direction).shape == (1, 1)


def test_equation_17_is_the_inverse_for_the_covariance_not_for_the_moment():
    """Erratum VS-2: the right-hand side is the recursion of H (Sherman-Morrison), not that of M."""
    learner = network(forgetting=0.97, regularisation=1e-2, maximum_trace=np.inf)
    shifts, poses = samples(np.random.default_rng(9), 41)
    learner.fit(shifts[:40], poses[:40])
    old, phi = learner.covariance, learner.hidden_output(shifts[40])
    learner.update(shifts[40], poses[40])
    assert np.allclose(
        learner.covariance, np.linalg.inv(0.97 * np.linalg.inv(old) + np.outer(phi, phi)), rtol=1e-6
    )


def test_errors_before_and_after_learning_are_those_of_the_network():
    learner = network()
    shifts, poses = samples(np.random.default_rng(10), 101)
    learner.fit(shifts[:100], poses[:100])
    before = poses[100] - learner.hidden_output(shifts[100]) @ learner.weights
    result = learner.update(shifts[100], poses[100])
    after = poses[100] - learner.hidden_output(shifts[100]) @ learner.weights
    assert np.allclose(result.prior_error, before, atol=1e-12)
    assert np.allclose(result.posterior_error, after, atol=1e-9)
    assert np.linalg.norm(after) < np.linalg.norm(before)


def test_forgetting_with_constant_input_blows_up_unless_it_is_bounded():
    """An hour at one place: the covariance stays bounded, and the error is back to normal on return."""
    rng = np.random.default_rng(11)
    shifts, poses = samples(rng, 300)
    errors, traces = {}, {}
    for name, bound in (("bounded", 1e7), ("unbounded", np.inf)):
        learner = network(forgetting=0.99, maximum_trace=bound)
        learner.fit(shifts, poses)
        for _ in range(72000 if name == "bounded" else 3000):
            learner.update(shifts[0] + rng.normal(0.0, 1e-12, GRATINGS), poses[0])
        traces[name] = learner.trace
        back = [np.abs(learner.update(*pair).prior_error[:3]).max() for pair in zip(shifts, poses)]
        errors[name] = max(back[100:])
    assert traces["bounded"] <= 1e7 < 1e10 < traces["unbounded"]
    assert errors["bounded"] < 5e-3 < 1.0 < errors["unbounded"] < np.inf


@settings(max_examples=50, deadline=None)
@given(st.lists(st.floats(-1e3, 1e3), min_size=4, max_size=4))
def test_unit_quaternion_has_length_one(values):
    assert np.isclose(np.linalg.norm(unit_quaternion(values)), 1.0)


def test_quaternion_without_a_direction_becomes_the_identity():
    broken = np.array([[0.0, 0, 0, 0], [np.nan, 0, 0, 1], [0, np.inf, 0, 1], [1e-10, 0, 0, 0]])
    assert np.array_equal(unit_quaternion(broken), np.tile([0.0, 0, 0, 1], (4, 1)))
    for one in broken:
        assert np.array_equal(unit_quaternion(one), [0, 0, 0, 1])


def test_one_quaternion_is_scaled_as_one_of_many():
    many = np.random.default_rng(15).normal(size=(20, 4))
    assert np.allclose(unit_quaternion(many), [unit_quaternion(one) for one in many], rtol=1e-15)


def test_prediction_is_a_unit_quaternion_even_before_training():
    pose = network().predict(np.full(GRATINGS, 1e-6))
    assert np.isfinite(pose).all()
    assert np.isclose(np.linalg.norm(pose[3:]), 1.0)


def test_sign_of_the_label_quaternion_does_not_matter():
    shifts, poses = samples(np.random.default_rng(12), 120)
    flipped = poses.copy()
    flipped[::3, 3:] *= -1.0
    networks = [network(), network()]
    for learner, labels in zip(networks, (poses, flipped)):
        learner.fit(shifts[:100], labels[:100])
        for shift, label in zip(shifts[100:], labels[100:]):
            learner.update(shift, label)
    turn = same_hemisphere(networks[1].predict(shifts), networks[0].predict(shifts))
    assert np.allclose(turn, networks[0].predict(shifts), atol=1e-12)


def test_variance_covers_the_prediction_error():
    rng = np.random.default_rng(13)
    shifts, poses = samples(rng, 2000)
    labels = poses.copy()
    labels[:, :3] += rng.normal(0.0, 5e-4, (2000, 3))
    learner = network(forgetting=1.0)
    learner.fit(shifts[:500], labels[:500])
    within = []
    for shift, label in zip(shifts[500:], labels[500:]):
        predicted, variance = learner.predict_with_variance(shift)
        within.append(np.abs(label[:3] - predicted[:3]) < 1.96 * np.sqrt(variance))
        learner.update(shift, label)
    assert 0.9 < np.mean(within) < 0.99


@pytest.mark.parametrize(
    ("shift", "message"),
    [
        (np.zeros(3), r"shift must have shape \(\.\.\., 4\), got \(3,\)"),
        (np.array([0.0, np.nan, 0.0, np.inf]), r"gratings \[1, 3\]"),
    ],
)
def test_bad_shift_is_refused_and_named(shift, message):
    for call in (network().predict, lambda value: network().update(value, [0, 0, 0, 0, 0, 0, 1])):
        with pytest.raises(ValueError, match=message):
            call(shift)


def test_bad_label_teaches_nothing():
    learner = network()
    shifts, poses = samples(np.random.default_rng(14), 50)
    learner.fit(shifts, poses)
    weights = learner.weights.copy()
    result = learner.update(shifts[0], np.full(7, np.nan))
    assert not result.accepted
    assert "finite" in result.reason
    assert np.array_equal(learner.weights, weights)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"hidden": 0}, "hidden"),
        ({"width_range": (0.0, 1.0)}, "width_range"),
        ({"regularisation": 0.0}, "regularisation"),
        ({"forgetting": 1.1}, "forgetting"),
        ({"input_scale": np.nan}, "input_scale"),
        ({"maximum_trace": 0.0}, "maximum_trace"),
    ],
)
def test_bad_parameters_are_refused(options, message):
    with pytest.raises(ValueError, match=message):
        ExtremeLearningMachine(np.random.default_rng(0), **options)
