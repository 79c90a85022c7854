"""Tables I and II: the comparison of the controllers on one path; small but real."""

import numpy as np
import pytest

from soro_lib.papers.visual_strain_fusion.experiments import hybrid_control, tracking
from soro_lib.papers.visual_strain_fusion.experiments.tracking import FittedPlant
from soro_lib.papers.visual_strain_fusion.world.plant import ChamberParameters

IDEAL = FittedPlant(ChamberParameters(), 0.0)
FEW = {name: hybrid_control.READINGS[name] for name in ("literal", "no learning")}


def run_circle():
    return hybrid_control.compare_controllers(
        "circle", np.random.default_rng(1), seeds=2, cycles=1, readings=FEW
    )


@pytest.fixture(scope="module")
def comparison():
    return run_circle()


def test_same_seed_gives_the_same_tips(comparison):
    again = run_circle()
    assert np.array_equal(comparison.compensated["literal"].tip, again.compensated["literal"].tip)


def test_compensated_runs_go_on_where_the_model_stopped(comparison):
    jump = comparison.compensated["literal"].tip[0] - comparison.model.tip[-1]
    assert np.linalg.norm(jump, axis=-1).max() < 3e-3


def test_summary_has_one_row_per_run(comparison):
    summary = hybrid_control.summarise(comparison)
    assert len(summary) == 3 * 2 * 4
    assert np.allclose(summary.error_percent, summary.error_mm / 0.03)
    table = hybrid_control.learning_against_no_learning(summary, np.random.default_rng(1))
    assert (table.difference_low_mm <= table.difference_mm).all()
    improvements = hybrid_control.improvements(summary)
    first = improvements.iloc[0]
    model = summary[
        (summary.controller == "model") & (summary.gain == first.gain) & (summary.seed == first.seed)
    ]
    mine = summary[(summary.controller == first.controller) & (summary.gain == first.gain)]
    expected = 100 * (1 - mine[mine.seed == first.seed].error_mm.iloc[0] / model.error_mm.iloc[0])
    assert first.error_improvement_percent == pytest.approx(expected)


def test_deviation_is_the_distance_to_the_circle(comparison):
    exact = np.abs(np.linalg.norm(comparison.model.tip, axis=-1) - tracking.RADIUS)
    assert np.allclose(comparison.model.deviation(comparison.points), exact, atol=2e-5)


def test_cap_of_the_step_is_what_slows_an_ideal_arm():
    """The control of the 3 mm hypothesis with nothing fitted: at low gain the cap costs most of it."""
    errors = {}
    for cap in (3e-3, np.inf):
        run = hybrid_control.compare_controllers(
            "circle",
            np.random.default_rng(1),
            seeds=1,
            readings={},
            plant=IDEAL,
            maximum_step=cap,
        )
        errors[cap] = run.model.error.mean(axis=0)[0]
    assert errors[3e-3][0] > 3 * errors[np.inf][0]
    assert errors[3e-3][3] < 2 * errors[np.inf][3]
