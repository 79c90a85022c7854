"""Findings: the arithmetic of the scorecard, and the index of equations."""

from soro_lib.papers.gesture_steering import findings as results
from soro_lib.papers.gesture_steering.calibration import POINTS
from soro_lib.replication.equations import index_problems
from soro_lib.replication.scorecard import build_scorecard


def test_every_equation_has_function_and_test():
    assert index_problems("gesture_steering") == []


def test_arithmetic_of_the_scorecard():
    found = results.parameter_findings() | results.table1_findings() | results.table2_findings()
    card = build_scorecard("gesture_steering", found).set_index("id")
    arithmetic = card[card["kind"].isin(["arithmetic", "definition"]) & (card["verdict"] != "not attempted")]
    differs = set(arithmetic.index[arithmetic["verdict"] == "differs"])
    assert differs == {"table1_axial_stiffness_high", "s3d_gesture_combinations", "table2_c2_tip_error_y"}
    assert (card.loc[[f"table2_c1_{point}_sim_z" for point in POINTS], "verdict"] != "reproduced").all()
