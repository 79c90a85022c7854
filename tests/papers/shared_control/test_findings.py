"""Every number and claim of the paper gets a finding."""

from soro_lib.papers.shared_control.findings import findings
from soro_lib.replication.scorecard import build_scorecard


def test_every_claim_of_the_demonstrations_is_published_and_judged(crowd, tuning):
    scorecard = build_scorecard("shared_control", findings(crowd, tuning))
    missing = scorecard[(scorecard["verdict"] == "not attempted") & (scorecard["kind"] != "hardware")]
    assert missing.empty
    assert set(scorecard["verdict"]) <= {"reproduced", "close", "differs", "not attempted"}
