"""Errata of Wang et al. that are arithmetic, or about what an experiment can show."""

import numpy as np
import pytest

from soro_lib import paths
from soro_lib.papers.visual_strain_fusion.experiments import collisions, estimation


def test_steps_of_three_millimetres_would_need_a_huge_circle():
    """Erratum VS-13: 750 steps around 30 mm are 0.25 mm each; the printed percentages divide by 3 mm."""
    around = paths.circle(np.arange(751) / 750, 30.0)
    assert np.linalg.norm(np.diff(around, axis=0), axis=1).mean() == pytest.approx(0.251, abs=1e-3)
    star = paths.pentagram(np.arange(1001) / 1000, 30.0)
    assert np.linalg.norm(np.diff(star, axis=0), axis=1).mean() == pytest.approx(0.285, abs=1e-3)
    assert 750 * 3.0 / (2 * np.pi) == pytest.approx(358, abs=0.2)
    for error, percent in ((16.942, 564.2), (2.305, 76.8), (28.910, 967.1), (2.803, 93.4)):
        assert 100 * error / percent == pytest.approx(3.0, abs=0.02)
        assert 100 * error / percent > 10 * 0.285


def test_one_percentage_of_table_1_does_not_fit_its_neighbours():
    """Erratum VS-14."""
    cells = {(0.04, "hybrid"): (0.696, 6.9), (0.04, "model"): (3.646, 18.9), (0.06, "hybrid"): (0.492, 2.6)}
    distances = {key: 100 * deviation / percent for key, (deviation, percent) in cells.items()}
    assert 18.0 < distances[0.04, "model"] < 20.5
    assert 18.0 < distances[0.06, "hybrid"] < 20.5
    assert distances[0.04, "hybrid"] < 10.2
    assert pytest.approx(3.7, abs=0.05) == 100 * 0.696 / 19.0


def test_table_2_repeats_deviations_of_table_1():
    """Erratum VS-15: four standard deviations at K_p = 0.08, in the same order; no other row shares any."""
    first = {0.04: (5.421, 3.301, 1.917, 0.832), 0.08: (2.486, 0.401, 1.326, 0.335)}
    second = {0.04: (3.330, 4.238, 3.537, 4.073), 0.08: (2.486, 0.401, 1.326, 0.335)}
    assert first[0.08] == second[0.08]
    assert not set(first[0.04]) & set(second[0.04])


def test_percentages_of_the_light_test():
    """Erratum VS-16."""
    assert pytest.approx(3.3, abs=0.05) == 100 * 1.324 / 40.23
    assert pytest.approx(7.7, abs=0.05) == 100 * 3.116 / 40.23
    assert 1.324 < 3.116
    assert sum(reduction > 80 for reduction in (86.4, 84.4, 76.9, 68.9, 90.1, 75.5, 70.7, 52.3)) == 3


def test_mean_of_ratios_is_not_the_ratio_of_means():
    """Erratum VS-17: 0.82/0.12 is 683 %; steps that vary make the mean of the ratios larger."""
    assert pytest.approx(683, abs=1) == 100 * 0.82 / 0.12
    steps = 0.12 * np.random.default_rng(1).lognormal(-0.5, 1.0, 5000)
    assert np.mean(0.82 / steps) > 1.3 * 0.82 / steps.mean()


def test_initial_samples_of_the_fibre_cannot_change_the_camera():
    """Erratum VS-19: under the identical flick the camera errs the same, however the fibre began."""
    errors = []
    for contact in collisions.sample_counts((450, 900)).values():
        run = collisions.run_contacts(contact, np.random.default_rng(3), steps=2700)
        errors.append(run.errors()["slam"][run.event >= 0])
    assert np.array_equal(*errors)


@pytest.fixture(scope="module")
def windows():
    return estimation.window_errors(1, windows=(150, 450), every=300).set_index("window")


def test_window_shorter_than_the_hidden_layer_interpolates_noise(windows):
    """Erratum VS-4: 150 samples, 200 nodes: nothing remains of labels that carry 0.6 mm of noise."""
    assert windows.posterior_label_mm[150] < 1e-6
    assert windows.prior_label_mm[150] > 1.0


def test_nothing_predicts_white_label_noise(windows):
    """Erratum VS-20: before learning a label, its own noise remains: 0.6 mm, not 8e-4 mm."""
    assert windows.prior_label_mm.min() > 0.5
