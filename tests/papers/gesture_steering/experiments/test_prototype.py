"""The simulated prototype: errors of the paper's size, and sessions that repeat themselves."""

import numpy as np
import pytest

from soro_lib.papers.gesture_steering.calibration import printed_positions
from soro_lib.papers.gesture_steering.experiments import prototype
from soro_lib.papers.gesture_steering.recordings import HOVER


def rng(seed=0):
    return np.random.default_rng(seed)


def test_experiment_error_is_the_norm():
    """Lai et al., Eq. (28)."""
    assert prototype.experiment_error([1.0, 2.0, 3.0], [1.0, 5.0, 7.0]) == pytest.approx(5.0)
    assert prototype.experiment_error(printed_positions("sim"), printed_positions("exp")).shape == (4, 3)


def test_prototype_sessions_repeat_themselves():
    first, second = (prototype.table2_sessions(rng(4), 20) for _ in range(2))
    assert first.equals(second)


def test_errors_of_the_prototype_are_of_the_papers_size_without_any_fit():
    sessions = prototype.table2_sessions(rng(1), 200)
    placed = prototype.printed_percentiles(sessions).set_index(["configuration", "point"])
    assert (placed.loc[(slice(None), ["base", "mid"]), "percentile"].between(2.5, 97.5)).all()
    assert 0.0 <= prototype.within_claim(sessions).mean() < 0.5


def test_frame_at_the_straight_tip_explains_the_order_of_table2():
    plain = prototype.table2_sessions(rng(1), 200)
    registered = prototype.table2_sessions(rng(1), 200, registered_at_tip=True)
    norms = [t[t["configuration"] == 0].groupby("point")["norm_mm"].median() for t in (plain, registered)]
    assert norms[0]["tip"] > norms[0]["base"]
    assert norms[1]["tip"] < norms[1]["mid"] < norms[1]["base"]


def test_hover_is_longer_than_it_settles():
    commands = prototype.fig10_commands()
    assert set(commands) == {"a", "b", "c", "d"}
    assert commands["a"]["time_s"].max() == pytest.approx(HOVER, abs=0.1)
    measured = prototype.fig10({"a": commands["a"]}, rng(1), sessions=4, every=20)
    assert prototype.steady_state(measured)["position_error_mm"].between(0.2, 10.0).all()
