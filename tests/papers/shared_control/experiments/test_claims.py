"""The ordinal claims."""

import pandas as pd

from soro_lib.papers.shared_control.experiments import claims


def invented(times, errors, force=0.05):
    """Two operators of each kind in each environment with given mean times and errors by paradigm."""
    rows = [
        {
            **{"environment": environment, "kind": kind, "operator": operator, "paradigm": name},
            **{"time_s": time, "release_error_mm": error, "finished": 1.0, "path_m": 3.0},
            "assistance_n": force if name == "assist_as_needed" else 1.0,
        }
        for environment in ("simulated", "real")
        for kind in ("expert", "naive")
        for operator in range(2)
        for name, time, error in zip(claims_order(), times, errors)
    ]
    return pd.DataFrame(rows)


def claims_order():
    return [claims.FULL, claims.AAN, claims.FIXED, claims.MSAE, claims.ASME, claims.AUTO]


def test_claims_hold_where_they_are_built_to_hold_and_fail_where_not():
    good = claims.evaluate_claims(invented((60, 59, 51, 50, 40, 30), (20, 19, 16, 15, 10, 5)))
    held = good.groupby("claim")["holds"].mean()
    expected = {"aan_shorter_fixed", "aan_more_accurate_fixed", *claims.PAIR_CLAIMS, claims.ACROSS_CLAIM}
    assert set(held[held < 1].index) == expected
    bad = claims.evaluate_claims(invented((30, 60, 10, 50, 60, 70), (1, 5, 100, 9, 10, 15), force=2.0))
    failed = bad.groupby("claim")["holds"].mean()
    assert set(failed[failed > 0].index) == {
        "auto_error_not_zero",
        "stable",
        "fixed_less_accurate_msae",
        "aan_more_accurate_fixed",
    }


def test_probabilities_lie_between_zero_and_one(crowd):
    probabilities = claims.claim_probabilities(claims.evaluate_claims(crowd))
    assert probabilities["probability"].between(0, 1).all()
    assert probabilities["id"].is_unique
