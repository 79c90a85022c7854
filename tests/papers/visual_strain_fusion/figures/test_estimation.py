"""Figures of the learning estimator: nothing is drawn that rounding decides."""

import numpy as np
import pandas as pd

from soro_lib.papers.visual_strain_fusion.experiments.estimation import ROUNDING_LIMIT, LearningRun
from soro_lib.papers.visual_strain_fusion.figures import estimation as figures


def test_lines_end_where_rounding_takes_over_with_a_mark_and_a_word():
    steps = np.arange(400)
    trace = 1e6 * 1.05**steps
    error = np.where(trace > 1e12, 1e3, 1e-3)
    run = LearningRun(steps, error, np.zeros((400, 3)), np.zeros((400, 3)), trace, 1.0)
    figure = figures.elm_blow_up({"unbounded": run}, (100, 200))
    assert max(figure.axes[0].lines[0].get_ydata()) <= ROUNDING_LIMIT
    assert max(figure.axes[1].lines[0].get_ydata()) < 1.001
    assert "rounding" in figure.axes[0].texts[0].get_text()
    assert "diverges" in figure.axes[1].texts[0].get_text()


def test_a_diverged_network_is_a_word_and_not_a_point():
    columns = ["prior_mean_mm", "prior_label_mm", "posterior_label_mm"]
    rows = [("sound", 0.7), ("sound", 0.8), ("wild", np.inf), ("wild", np.inf)]
    table = pd.DataFrame([{"network": name, **dict.fromkeys(columns, value)} for name, value in rows])
    axes = figures.elm_before_and_after(table).axes[0]
    assert [text.get_text() for text in axes.texts] == ["diverged: errors beyond 1 m"]
    np.testing.assert_allclose(np.asarray(axes.lines[0].get_xdata(), dtype=float), [0.75, np.nan])
