"""Studies of the fibre, its network and contacts; small but real."""

import numpy as np
import pandas as pd

from soro_lib.papers.visual_strain_fusion.experiments import estimation


def test_network_predicts_better_than_its_labels_and_forgets_nothing_by_default():
    networks = {name: estimation.NETWORKS[name] for name in ("default", "no forgetting")}
    table = estimation.compare_networks(1, seeds=1, networks=networks, steps=1500).set_index("network")
    label_noise = 1e3 * np.linalg.norm(estimation.LABEL_NOISE)
    assert (table.prior_mean_mm < 0.9 * label_noise).all()
    assert (table.posterior_label_mm < table.prior_label_mm).all()


def test_standing_still_blows_up_only_what_is_unbounded():
    runs = estimation.hold_still(1)
    worst = {name: run.prior[-1000:].max() for name, run in runs.items()}
    assert worst["w = 0.99, bounded"] < 2e-3
    assert worst["no forgetting"] < 2e-3
    assert worst["w = 0.99, unbounded"] > 1.0


def learning_run(trace, error=1e-3, condition=1e5):
    steps = len(trace)
    prior, label = np.full(steps, error), np.full((steps, 3), error / 3)
    return estimation.LearningRun(np.arange(steps), prior, label, label, np.array(trace), condition)


def test_steps_are_resolved_until_the_trace_first_leaves_what_rounding_allows():
    assert learning_run([1e6, 1e9]).resolved.all()
    assert learning_run([1e6, 1e11, 1e9]).resolved.tolist() == [True, False, False]
    assert learning_run([1e6, -1e9, 1e9]).resolved.tolist() == [True, False, False]
    assert learning_run([1e6, np.nan, 1e9]).resolved.tolist() == [True, False, False]


def test_what_rounding_decides_is_said_in_words():
    runs = {
        "sound": learning_run([1e6, 1e7], error=1.23456789e-3, condition=123456.789),
        "unbounded": learning_run([1e6, 1e11], error=1.23456789e-3, condition=1e11),
        "diverged": learning_run([1e6, -1e20], error=1e4, condition=1e11),
    }
    rows = [{"network": name, **estimation._errors(run)} for name, run in runs.items()]
    table = estimation.settings_table(pd.DataFrame(rows)).set_index("network")
    assert table.prior_mean_mm.tolist() == ["1.23457", "1.23", "diverged"]
    assert table.trace.tolist() == ["1e+07", "beyond 1e+10", "beyond 1e+10"]
    assert table.condition.tolist() == ["123457", "beyond 1e+10", "beyond 1e+10"]


def test_more_initial_samples_predict_better():
    table = estimation.initial_samples(1, seeds=1, counts=(450, 1800)).set_index("samples")
    assert table.next_mm[1800] < table.next_mm[450]
    assert table.frozen_mm[1800] < table.frozen_mm[450]
