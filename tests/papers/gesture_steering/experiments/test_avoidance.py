"""Past an obstacle: what the cost of Eq. (29) gives, and what the inequality guarantees."""

import numpy as np

from soro_lib.papers.gesture_steering.experiments import avoidance


def test_cost_of_eq29_does_not_guarantee_clearance():
    """Erratum GS-20: with eta = 10 the arm still collides; the inequality keeps it clear."""
    runs = {
        policy: avoidance.crossed(np.random.default_rng(1), "y 8, z 112", policy)
        for policy in avoidance.POLICIES
    }
    clearance = {policy: table["clearance_mm"].min() for policy, table in runs.items()}
    deviation = {
        policy: table[["deviation_x_mm", "deviation_y_mm", "deviation_z_mm"]].abs().max(axis=None)
        for policy, table in runs.items()
    }
    assert clearance["off"] < clearance["eta = 10"] < 0.0
    assert clearance["hard, 1 mm"] > 0.5
    assert deviation["hard, 1 mm"] < deviation["eta = 100"]
