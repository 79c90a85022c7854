"""What the handover study found, keyed as in ``data/soft_handover/published.csv``.

The same claims are tried on both plants; the scorecard takes plant K unless a row names plant E.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from soro_lib.controllers.handover import HandoverParameters
from soro_lib.controllers.virtual_stiffness import state_limits
from soro_lib.papers.soft_handover.experiments.handover import STEP_SIZES, block_times
from soro_lib.papers.soft_handover.experiments.vision import HIDDEN, SCENE
from soro_lib.papers.soft_handover.world.scene import STEREO
from soro_lib.replication.findings import Finding

Samples = NDArray[np.float64]


@dataclass(frozen=True)
class HandoverTables:
    """The tables of all experiments.

    Attributes
    ----------
    runs, traces : DataFrame
        Experiment 1 on both plants.
    guided : DataFrame
        Runs of experiment 2.
    use_cases : DataFrame
        Runs of experiment 3.
    without_estimation : DataFrame
        Runs with and without the state optimisation.
    suggestions : DataFrame
        Runs of the thesis's suggestions.
    """

    runs: pd.DataFrame
    traces: pd.DataFrame
    guided: pd.DataFrame
    use_cases: pd.DataFrame
    without_estimation: pd.DataFrame
    suggestions: pd.DataFrame

    def on(self, plant: str) -> "HandoverTables":
        """Return the rows of one plant."""
        return HandoverTables(*(table[table["plant"] == plant] for table in vars(self).values()))


def by_block(
    runs: pd.DataFrame, columns: str, values: str, statistic: Literal["mean", "median"] = "median"
) -> pd.DataFrame:
    """Return a statistic of the runs of each block."""
    return runs.pivot_table(index="block", columns=columns, values=values, aggfunc=statistic)


def claims(tables: HandoverTables) -> dict[str, Samples]:
    """Return for every ordinal claim of the thesis, per block or run of one plant, whether it held (1 or
    0)."""
    runs, traces, bare = tables.runs, tables.traces, tables.without_estimation
    medians, guided = by_block(runs, "alpha", "steps"), by_block(tables.guided, "alpha", "steps")
    overshoot = by_block(runs, "alpha", "overshoot_mm")
    steps = by_block(tables.suggestions, "controller", "steps", "mean")
    miss = by_block(tables.suggestions, "controller", "miss_mm")
    small = traces[traces["alpha"] == STEP_SIZES[0]]
    keys = ["alpha", "block", "run"]
    thesis = steps["thesis, step 0.4"]
    return {
        "fig08_faster_with_step": as_samples(np.all(np.diff(medians[list(STEP_SIZES)]) < 0, axis=1)),
        "fig08_slope_with_error": each(traces, keys, falls_fastest_far_away),
        "s51_error_rises_between_stages": each(traces, keys, rises_between_stages),
        "s51_tail_at_small_step": each(runs[runs["alpha"] == STEP_SIZES[0]], ["block"], has_straggler),
        "fig09_gap_grows": each(small, keys, gap_grows),
        "fig09_start_offset": each(small, keys, lambda run: run["true_mm"].iloc[0] > 5.0),
        "s42_similar_steps": each(traces, ["block"], ends_with_similar_gaps),
        "fig10_estimate_closer": each(traces, keys, estimate_is_closer),
        "s33_estimation_needed": as_samples(~bare.loc[~bare["estimated"], "success"].astype(bool)),
        "s43_guided_faster_01": as_samples(guided[0.1] < medians[0.1].reindex(guided.index)),
        "s43_guided_faster_02": as_samples(guided[0.2] < medians[0.2].reindex(guided.index)),
        "s54_overshoot_with_step": as_samples(np.all(np.diff(overshoot[list(STEP_SIZES)]) > 0, axis=1)),
        "s54_variable_step_faster": as_samples(steps["error-dependent step"] < thesis),
        "s54_measurement_noise_faster": as_samples(steps["measured noise in filters"] < thesis),
        "s54_bound_from_noise_better": as_samples(
            miss["measured noise + pose bound from it"] < miss["measured noise in filters"]
        ),
        "s54_state_weights_better": as_samples(steps["state-dependent weights"] < thesis),
    }


def claims_on_both(tables: HandoverTables) -> pd.DataFrame:
    """Return the share of blocks or runs in which each claim held, per plant, and whether it holds on
    both."""
    by_plant = {plant: claims(tables.on(plant)) for plant in PLANT_SUFFIXES}
    shares = pd.DataFrame({f"plant {p}": {k: v.mean() for k, v in c.items()} for p, c in by_plant.items()})
    shares["holds on both"] = (shares >= 0.8).all(axis=1)
    return shares.rename_axis("claim").reset_index()


def as_samples(held: ArrayLike) -> Samples:
    """Return truth values as 1 and 0."""
    return np.asarray(held, dtype=float).ravel()


def each(table: pd.DataFrame, keys: list[str], held: Callable[[pd.DataFrame], bool]) -> Samples:
    """Return for every group whether a claim held in it."""
    return as_samples([held(group) for _, group in table.groupby(keys, sort=False)])


def falls_fastest_far_away(run: pd.DataFrame) -> bool:
    """Return whether the first stage's error falls the faster the larger it is (correlated over its
    steps)."""
    error = run.loc[run["descending"] == 0, "error_mm"].dropna().to_numpy()
    if len(error) < 4:
        return False
    return bool(np.corrcoef(error[:-1], -np.diff(error))[0, 1] > 0)


def rises_between_stages(run: pd.DataFrame) -> bool:
    """Return whether the error is larger at the first look of the second stage than at the last of the
    first."""
    second = run["descending"].to_numpy() == 1
    if not second.any() or second.all():
        return False
    start = int(np.argmax(second))
    error = run["error_mm"].to_numpy()
    return bool(error[start] > error[start - 1])


def has_straggler(block: pd.DataFrame) -> bool:
    """Return whether the slowest of eight runs takes half as long again as the median."""
    return bool(block["steps"].max() > 1.5 * block["steps"].median())


def gap_grows(run: pd.DataFrame) -> bool:
    """Return whether commanded and measured gripper are at least 2 cm farther apart at the end than at the
    start."""
    return bool(run["commanded_gap_mm"].iloc[-1] > run["commanded_gap_mm"].iloc[0] + 20.0)


def ends_with_similar_gaps(block: pd.DataFrame) -> bool:
    """Return whether the final gap at all step sizes is within a quarter of that at the smallest."""
    last = block.groupby(["alpha", "run"], sort=False)["commanded_gap_mm"].last().groupby("alpha").mean()
    return bool((np.abs(last[list(STEP_SIZES)] / last[STEP_SIZES[0]] - 1) <= 0.25).all())


def estimate_is_closer(run: pd.DataFrame) -> bool:
    """Return whether f(q_est) is at least as close to the measured gripper as f(q_sys), at every step."""
    seen = run.dropna(subset=["estimated_gap_mm"])
    return bool((seen["estimated_gap_mm"] <= seen["commanded_gap_mm"] + 5.0).all())


def findings(tables: HandoverTables, timestep: Mapping[float, float]) -> dict[str, Finding]:
    """Return the findings of all experiments without cameras, keyed by the id of the published row.

    Parameters
    ----------
    tables : HandoverTables
    timestep : mapping of float to float
        Duration of a step [s] by step size, the thesis's.
    """
    result = definition_findings()
    for plant in PLANT_SUFFIXES:
        result |= plant_findings(tables.on(plant), plant, timestep)
    on_k, on_e = tables.on("K"), tables.on("E")
    claims_k, claims_e = claims(on_k), claims(on_e)
    for name, samples in claims_k.items():
        reason = f"plant E: {claims_e[name].mean():.2f}. {CLAIM_REASONS.get(name, '')}"
        result[name] = Finding(samples, reason.strip())
    result["fig09_start_offset"] = Finding(
        claims_e["fig09_start_offset"],
        "plant E hangs 9 mm too low; plant K knows no weight and starts where it should",
    )
    result["s51_tail_at_small_step_plant_e"] = Finding(
        claims_e["s51_tail_at_small_step"], "as Table 1's slowest run: the error floor, and wound-up tendons"
    )
    median = block_times(on_k.runs, timestep).pivot(index="block", columns="alpha", values="median_s")
    result["s51_ratio_01_02"] = Finding(
        median[0.1] / median[0.2], "above 2 because of the error floor at 0.1"
    )
    result["s51_ratio_02_04"] = Finding(median[0.2] / median[0.4], "below 2 because of the wrist's filter")
    result["s43_guided_success"] = Finding(4 * on_k.guided.groupby("block")["success"].mean())
    result["s44_use_case_success"] = Finding(on_k.use_cases.groupby("block")["dropped"].sum())
    residuals = on_k.traces.dropna(subset="estimate_residual_mm")
    at_bound = np.isclose(residuals["estimate_residual_mm"], 5.0, atol=1e-3)
    result["s52_residual_at_bound"] = Finding(
        pd.Series(at_bound).groupby(residuals["block"].to_numpy()).mean(),
        "the first looks can lie within the bound, where the commanded state itself is the optimum",
    )
    return result


CLAIM_REASONS = {
    "s51_tail_at_small_step": (
        "At 0.1 the error stalls at 5 mm / 0.1 = 50 mm, the stop threshold, and noise ends the run; "
        "how long that takes depends on the noise of the cameras"
    ),
    "s42_similar_steps": (
        "the commanded state winds up more with larger steps, since the wrist's filter lags behind"
    ),
    "s54_variable_step_faster": "with the thesis's filters it also overshoots more",
    "s54_bound_from_noise_better": "the bound costs an error floor of bound over step size",
    "s54_state_weights_better": "the weights hardly change where the arm goes; the constraint does",
    "fig10_estimate_closer": "to within the bound of 5 mm",
}
"""Why a claim comes out as it does."""


TIME_REASONS = {
    "K": "steps times the thesis's timestep; a smooth plant without friction or creep spreads less",
    "E": "steps times the thesis's timestep; slow: balls opposite a tendon, where a slack one gives way",
}
"""Why the times come out as they do."""

FLOOR_REASON = "every run waits on the error floor until noise ends it, and the rendered cameras are quiet"
"""What is special about the smallest step size."""

PLANT_SUFFIXES = {"K": "", "E": "_plant_e"}
"""Ends of the ids of rows that stand for each plant."""


DISTANCE_REASONS = {
    "K": "plant K was fitted without noise",
    "E": "runs to balls opposite a tendon wind the command up and raise the mean",
}
"""Why the distances come out as they do."""


def plant_findings(tables: HandoverTables, plant: str, timestep: Mapping[float, float]) -> dict[str, Finding]:
    """Return, per block of eight runs on one plant, the times of Table 1 [s], how many runs succeed, and the
    final distances of Section 5.2 [cm]."""
    suffix = PLANT_SUFFIXES[plant]
    result = {}
    times = block_times(tables.runs, timestep)
    for step_size in STEP_SIZES:
        blocks = times[times["alpha"] == step_size]
        row = f"{round(10 * step_size):02d}{suffix}"
        reason = f"{TIME_REASONS[plant]}; {FLOOR_REASON}" if step_size == 0.1 else TIME_REASONS[plant]
        for statistic in ("min", "median", "max", "mean", "sd"):
            result[f"table1_{statistic}_{row}"] = Finding(blocks[f"{statistic}_s"], reason)
        result[f"s4_success_{row}"] = Finding(
            blocks["successes"], "depends on how wide the gripper opens: 40 mm are assumed"
        )
    small = tables.traces[tables.traces["alpha"] == STEP_SIZES[0]]
    last = small.groupby(["block", "run"]).last().groupby("block").mean(numeric_only=True) / 10
    for row, column in (("measured_distance", "measured"), ("commanded_distance", "commanded")):
        result[f"s52_{row}{suffix}"] = Finding(last[f"{column}_mm"], DISTANCE_REASONS[plant])
    result[f"s52_gap{suffix}"] = Finding(last["commanded_gap_mm"], DISTANCE_REASONS[plant])
    return result


def definition_findings() -> dict[str, Finding]:
    """Return the printed parameters as the code has them."""
    parameters = HandoverParameters()
    control, filters, arm = parameters.control, parameters.filters, parameters.control.arm
    lower, upper = state_limits(arm)
    points = arm.tip_points(arm.home)
    values: dict[str, float] = {
        "appa_wrist_z": points[2],
        "appa_gripper_z": points[5],
        "appa_d_gripper": arm.gripper_length,
        "appa_d_offset": parameters.grasp_offset,
        "appa_p_init": filters.ball.initial,
        "appa_eps_pose": parameters.pose_bound,
        "appa_n_max": control.max_iterations,
        "appa_eps_control": control.tolerance,
        "appa_eps_threshold": parameters.stop_threshold,
    }
    for name, noise in vars(filters).items():
        values |= {f"appa_q_{name}": noise.process, f"appa_r_{name}": noise.measurement}
    segments: dict[str, Iterable[float]] = {
        "s31_length": arm.rest_lengths,
        "eq11_bend": upper[::2],
        "eq11_shortest": lower[1::2],
        "eq11_longest": upper[1::2],
        "appa_weight": parameters.pose_weights[::3],
        "appa_k_bend": control.stiffness[::3],
        "appa_k_length": control.stiffness[2::3],
    }
    for name, three in segments.items():
        values |= {f"{name}_{number}": value for number, value in enumerate(three, start=1)}
    return {name: Finding(value) for name, value in values.items()}


BLOCK = 20
"""Poses that share one vote on a claim."""


def vision_findings(
    accuracy_table: pd.DataFrame, hidden: pd.DataFrame, places: pd.DataFrame
) -> dict[str, Finding]:
    """Return the findings of the vision study, keyed by the id of the published row.

    Parameters
    ----------
    accuracy_table : DataFrame
        Of :func:`soro_lib.papers.soft_handover.experiments.vision.accuracy`.
    hidden : DataFrame
        Of :func:`soro_lib.papers.soft_handover.experiments.vision_limits.occlusion`.
    places : DataFrame
        Of :func:`soro_lib.papers.soft_handover.experiments.vision_limits.workspace_limits`.
    """
    left, right = (view.pose[:3, 3] for view in STEREO)
    ball = accuracy_table[accuracy_table["estimator"] == "joint"].pivot(
        index="pose", columns="condition", values="ball_mm"
    )
    typical = ball.groupby(ball.index // BLOCK).median()
    largest = hidden[hidden["rule"] == "largest piece"]
    errors = largest.assign(hidden=largest["visible"] < HIDDEN, block=largest["pose"] // BLOCK)
    medians = by_block(errors, "hidden", "ball_mm").dropna()
    worst = {bool(key): group.quantile(0.95) for key, group in errors.groupby("hidden")["ball_mm"]}
    default = places[(places["field_of_view"] == "78 deg") & (places["limit"] != "")]
    parallel = default[default["cameras"] != "aimed at the arm"]
    return {
        "s32_baseline": Finding(float(np.linalg.norm(left - right))),
        "s324_marker_size": Finding(1e3 * SCENE.ring.marker),
        "s54_third_camera_better": Finding(
            (typical["three cameras"] < typical["all causes"]).astype(float),
            f"median {ball['all causes'].median():.2f} mm with two cameras, "
            f"{ball['three cameras'].median():.2f} mm with a third from the side, in blocks of {BLOCK} poses",
        ),
        "fig15_occlusion_hurts": Finding(
            (medians[True] > medians[False]).astype(float),
            f"95th percentile {worst[True]:.1f} mm hidden, {worst[False]:.1f} mm not hidden",
        ),
        "fig14_side_limits": Finding(
            (parallel["limit"] == "right").astype(float),
            "for parallel and half toed-in cameras; cameras aimed at the arm reverse it",
        ),
    }
