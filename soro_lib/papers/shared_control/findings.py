"""What the replication obtains for each number and claim of the paper."""

from collections.abc import Mapping

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from soro_lib.controllers.shared_control import PARADIGMS, AssistAsNeeded, FixedAssistance
from soro_lib.papers.shared_control.experiments import factorial
from soro_lib.papers.shared_control.experiments.claims import evaluate_claims
from soro_lib.papers.shared_control.experiments.demonstrations import TRIALS
from soro_lib.papers.shared_control.experiments.task import Scene
from soro_lib.papers.shared_control.world.plant import TRACKING_RATE
from soro_lib.replication.findings import Finding
from soro_lib.robots.soft_growing import REDISTRIBUTION

PRINTED_F: Mapping[str, float] = {
    "fmax_time": 146.078,
    "fmax_path": 69.470,
    "fmax_assistance": 22.415,
    "xi_time": 66.595,
    "xi_a_path": 90.909,
    "xi_s_path": 279.946,
    "kmax_assistance": 34.317,
    "interaction": 44.046,
}
"""Inputs of the arithmetic check of the printed p: nothing that is simulated sees them."""

ACTIVE = "operators who steer by sight leave the guidance little to do; seconds are lost only by passive ones"
IMPOSSIBLE = (
    "cannot be: H is the mean of a force that is capped at 7 N",
    "a higher k_MAX pulls harder, so a lower one cannot assist more",
)
SCATTER = "an F with two error degrees of freedom scatters over decades from one operator to the next"
REASONS: Mapping[str, str] = {
    "auto_shortest": "its three compulsory lifts cost a skilled operator more than steering by hand does",
    "auto_most_accurate": "under ASME x and y converge while the operator still lowers the tip",
    "auto_error_not_zero": "the tip creeps in; how near the real one gets depends on gains not printed",
    "gradual_time": "the lifts of the automatic eversion cost a skilled operator more than they save",
    "gradual_error": "ASME places better than Mostly Autonomous: its slower descent lets x and y converge",
    "asme_shorter": "a skilled operator moves two axes at once; descending by hand then waits for the lag",
    "asme_more_accurate": "lowering by hand turns the way to the goal; friction swallows the last correction",
    "fixed_like_msae_time": "the constant pull displaces the hand, and sight has to undo it",
    "fixed_like_msae_error": "a pull towards the true goal is undone by an operator who trusts his eyes",
    "aan_shorter_fixed": "a toss-up unless the force is taken for a cue",
    "aan_more_accurate_fixed": "a toss-up: neither force changes where an operator believes the goal to be",
    "aan_not_felt": "some experts rest outside th_D long enough to be pushed, more so on the real arm",
    "aan_shorter_full": "a toss-up person by person; only the mean over many shows a small gain, if any",
    "aan_more_accurate_full": "the item is released before the stiffness has risen, unless the dwell is long",
    "stable": "some naive users hunt against lag and delay until the time limit",
    "aan_gain_larger_simulated": "delay and lag of the real arm make the constant pull worse, not AAN better",
}
"""Why a claim holds as often as it does, where it is not plain; shown beside the verdict."""


def definitions() -> dict[str, Finding]:
    """Parameters as the library's defaults have them, and counts of the designs."""
    aan, fixed, scene = AssistAsNeeded(), FixedAssistance(), Scene()
    apart = np.linalg.norm(np.subtract(scene.items, scene.targets), axis=1)
    values = {
        "table3_refresh": aan.sample_rate,
        "table3_f_max": aan.maximum_force,
        "table3_fixed_k": fixed.rule.stiffness,
        "table3_fixed_b": fixed.rule.damping,
        "table3_filter": len(fixed.window),
        "table3_delta": aan.rule.stiffness_step * aan.sample_rate,
        "table3_th_d": 1e3 * aan.rule.near_distance,
        "table3_th_m": aan.rule.steady_speed,
        "table3_xi_s": aan.rule.steady_delay / aan.sample_rate,
        "table3_xi_c": aan.rule.approach_delay / aan.sample_rate,
        "table3_xi_a": aan.rule.away_delay / aan.sample_rate,
        "table3_k_max": aan.rule.maximum_stiffness,
        "factorial_settings": 2 ** len(factorial.FACTORS),
        "factorial_trials": 3 * 2 ** len(factorial.FACTORS),
        "demonstration_trials": TRIALS * len(PARADIGMS),
        "redistribution": REDISTRIBUTION,
        "tracking_rate": TRACKING_RATE,
    }
    for name, (low, high) in factorial.FACTORS.items():
        values |= {f"table2_{name}_low": low, f"table2_{name}_high": high}
    depth = "centres of the items in the authors' simulator; its table lies at 670 mm"
    distance = "the authors' simulator has 57 and 58 cm; 30 cm is the distance of the items"
    return {name: Finding(value) for name, value in values.items()} | {
        "plane_depth": Finding(1e3 * max(item[2] for item in scene.items), depth),
        "item_target_distance": Finding(1e2 * apart.mean(), distance),
    }


def printed_p_values() -> dict[str, Finding]:
    """The p that belong to the printed F(1, 2): they match only with two error degrees of freedom."""
    p = {name: factorial.printed_p_value(f) for name, f in PRINTED_F.items()}
    below = {name: Finding(p.pop(name) < 0.01) for name in ("fmax_time", "xi_s_path")}
    return {f"p_{name}": Finding(value) for name, value in p.items()} | {
        f"p_{name}_below": finding for name, finding in below.items()
    }


def factorial_findings(trials: pd.DataFrame) -> dict[str, Finding]:
    """Effects, F and signs of the tuning study; a sample per operator."""
    findings = {}
    for contrast in factorial.CONTRASTS:
        samples = factorial.contrast_samples(trials, contrast)
        effect = samples.mean(axis=1)
        why, against = IMPOSSIBLE if contrast.name == "kmax_assistance" else (ACTIVE, ACTIVE)
        findings[f"effect_{contrast.name}"] = Finding(effect, why)
        findings[f"f_{contrast.name}"] = Finding(factorial.blocked_f(samples), SCATTER, "median")
        findings[f"sign_{contrast.name}"] = Finding(np.sign(effect) == contrast.sign, against)
    interaction = factorial.interaction_samples(trials, "assistance_n", "xi_c", "xi_s")
    findings["f_interaction"] = Finding(factorial.blocked_f(interaction), SCATTER, "median")
    findings["sign_interaction"] = Finding(_largest_assistance(trials))
    findings["sign_error_insensitive"] = Finding(
        _error_insensitive(trials), "six tests at 5 % pass together in 74 % of studies by chance alone"
    )
    first = trials[trials["operator"] == 0]
    anova = factorial.repeated_measures_anova(first, "time_s")
    return findings | {"error_df": Finding(anova["df_error"].iloc[0])}


def _largest_assistance(trials: pd.DataFrame) -> NDArray[np.bool_]:
    """Whether H is largest for xi_C high and xi_S low, for each operator."""
    cells = trials.pivot_table(index="operator", columns=["xi_c", "xi_s"], values="assistance_n")
    return np.array([cell == (1, 0) for cell in cells.idxmax(axis=1)])


def _error_insensitive(trials: pd.DataFrame) -> NDArray[np.bool_]:
    """Whether no main effect on the placement error is significant, for each operator."""
    p = []
    for name in factorial.FACTORS:
        main = factorial.Contrast(name, "placement_error_mm", {name: 1}, {name: 0}, 1.0)
        p.append(factorial.printed_p_value(factorial.blocked_f(factorial.contrast_samples(trials, main))))
    return np.all(np.array(p) >= 0.05, axis=0)


def claim_findings(demonstrations: pd.DataFrame) -> dict[str, Finding]:
    """Every ordinal claim; a sample per operator, 1 where it holds."""
    held = evaluate_claims(demonstrations)
    return {
        str(name): Finding(group["holds"].to_numpy(), REASONS.get(group["claim"].iloc[0], ""))
        for name, group in held.groupby("id", sort=False)
    }


def findings(demonstrations: pd.DataFrame, tuning: pd.DataFrame) -> dict[str, Finding]:
    """All findings, keyed by the published row.

    Parameters
    ----------
    demonstrations : pandas.DataFrame
        Of `run_demonstrations`: both kinds, both environments.
    tuning : pandas.DataFrame
        Of `run_factorial`, several operators, three repetitions each.
    """
    return {
        **definitions(),
        **printed_p_values(),
        **factorial_findings(tuning),
        **claim_findings(demonstrations),
    }
