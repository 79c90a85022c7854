"""Findings, keyed by the ids of the published numbers (Wang et al.), and the paper's tables beside them."""

import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from soro_lib.controllers.hybrid import HybridSettings
from soro_lib.estimators.visual_strain import VisualStrainSettings
from soro_lib.papers.visual_strain_fusion.experiments.closed_curve import TARGETS
from soro_lib.papers.visual_strain_fusion.experiments.collisions import TABLE_VII, simulate_contacts, touches
from soro_lib.papers.visual_strain_fusion.experiments.fusion_runs import LIGHT_WINDOWS, window_errors
from soro_lib.papers.visual_strain_fusion.experiments.hybrid_control import MEASURES, improvements
from soro_lib.papers.visual_strain_fusion.experiments.tracking import GAINS
from soro_lib.papers.visual_strain_fusion.world.fibre import FibreGratings
from soro_lib.papers.visual_strain_fusion.world.motion import PERIOD, ArmMotion, glue_fibre, spiral
from soro_lib.replication.findings import Finding
from soro_lib.replication.scorecard import build_scorecard
from soro_lib.robots.pneumatic import CHAMBER_ANGLES, PneumaticArm

Array = NDArray[np.float64]

TABLES = {"pentagram": "table1", "circle": "table2"}
CONTROLLERS = {"model": "model", "literal": "hybrid"}
"""What the paper calls the controllers of its tables."""
STATISTICS = {"mean": "mm", "sd": "sd_mm", "percent": "percent"}
"""Ends of the ids of Tables I and II, and of the columns of `hybrid_control.summarise`."""
SHIFT_RANGE = 0.158e-9
STATIC_SHIFTS = {"max": 0.0040e-9, "mean": 9.07e-13}
TABLE_VII_ROWS = ("static", "straight1", "straight2", "curve1_1", "curve1_2", "curve2_1", "curve2_2")

WHY_CIRCLE = (
    "the printed column is worse at 0.06 than at 0.04, against the trend of both controllers; no mechanism "
    "of the plant gives that"
)
WHY_PERCENT = (
    "here the mean of deviation over the distance of the path point from the start; at the inner corners of "
    "the star that distance is small and weighs much, and the paper does not say which point it takes"
)
WHY_SPREAD = (
    "most of the spread is the approach after the switch, which depends on where the model had stopped"
)
WHY_MODEL_SPREAD = "standard deviations were not fitted"
WHY_CURVE = "another curve on a plant fitted to other paths: only the effects carry over"
WHY_FITTED_MAP = (
    "at the same Kp the fitted map takes away the plant's high gain, and with it the speed; the paper "
    "retuned Kp, to a value it does not give"
)
WHY_CONTACT = (
    "the paper's forces, sides and strength of the flick are not given; ours push to 15 mm from random sides"
)
WHY_SAMPLES = (
    "the flick here is identical for all numbers of samples, and the network learns on in all of them"
)
WHY_ELM = "a network cannot predict the noise of its labels; the printed number is that of an interpolation"

REASONS = {
    "accuracy": "two scenes only; no lens distortion, rolling shutter or hand-eye error: what is left is "
    "the drift of the map and the calibration of Eq. (30) on a short sweep",
    "hand": "two scenes; size, speed and places of the hand are not printed: it was enlarged once, until it "
    "hid all features in rare frames as the paper describes, before the second scene was run",
    "cover": "a camera that holds its last pose for 2 s errs by speed times time, 12 mm at 5.8 mm/s; the "
    "printed 38 mm need a wrong pose or a search that failed for longer",
    "light": "the length of the darkness is not printed; ours is 2 s, twice, as for the covers",
    "light slam": "agrees by coincidence: 3.4 % is printed for the camera too, but 3.116 of 40.23 mm is "
    "7.7 % (Erratum VS-16), and our camera errs less than the paper's",
    "steps": "follows from the error of the camera, which is smaller than the paper's",
}
"""Why a number may differ from the published one."""

FINDING_ROWS = (
    ("clean_{}_mean", "clean (0-100 s)", "mean_mm", "accuracy"),
    ("first50_{}_mean", "first 50 s", "mean_mm", "accuracy"),
    ("first50_{}_percent", "first 50 s", "percent_of_step", "steps"),
    ("hand_{}_mean", "hand in view", "mean_mm", "hand"),
    ("hand_{}_max", "hand in view", "max_mm", "hand"),
    ("cover_{}_max", "full cover", "max_mm", "cover"),
)
"""Numbers of the obstacle test: id, window, statistic, key of the reason."""


def definition_findings() -> dict[str, Finding]:
    """Parameters of the paper, as the library holds them."""
    arm, fibre, settings = PneumaticArm(), FibreGratings(), VisualStrainSettings()
    values = {
        "s4a_chamber_distance": 1e3 * arm.chamber_distance,
        "s4a_chamber_angle": np.degrees(np.diff(CHAMBER_ANGLES)[0]),
        "s4a_length": 1e3 * arm.rest_length,
        "s4a_diameter": 2e3 * fibre.radius,
        "s4a_gratings": fibre.gratings,
        "s4a_grating_spacing": 1e3 * fibre.spacing,
        "s4a_turn_pitch": 1e3 * fibre.pitch,
        "s4c_hidden_nodes": 200,
        "s4c_initial_samples": settings.initial_samples,
        "s4c_interval": PERIOD,
        "s2c_update_threshold": settings.update_threshold,
        "s2c_slam_rate_low": 1.0 / PERIOD,
        "s4d_step_cap": 1e3 * HybridSettings().maximum_step,
        "s4e_targets": TARGETS,
    }
    return {name: Finding(value) for name, value in values.items()}


def table_findings(summary: pd.DataFrame) -> dict[str, Finding]:
    """Tables I and II, and the claims about them, from `hybrid_control.summarise`."""
    findings = {}
    better = improvements(summary)
    literal = better[better.controller == "literal"]
    for path, table in TABLES.items():
        for gain in GAINS:
            cell = f"{table}_kp{100 * gain:02.0f}"
            runs = summary[(summary.path == path) & (summary.gain == gain)].groupby("controller")
            improved = literal[(literal.path == path) & (literal.gain == gain)]
            for measure in MEASURES:
                for controller, name in CONTROLLERS.items():
                    rows = runs.get_group(controller)
                    why = WHY_CIRCLE if (path, name) == ("circle", "hybrid") else ""
                    share = WHY_PERCENT if (path, measure) == ("pentagram", "deviation") else why
                    spread = WHY_SPREAD if name == "hybrid" else WHY_MODEL_SPREAD
                    for (statistic, column), reason in zip(STATISTICS.items(), (why, spread, share)):
                        finding = Finding(rows[f"{measure}_{column}"], reason)
                        findings[f"{cell}_{name}_{measure}_{statistic}"] = finding
                why = WHY_CIRCLE if path == "circle" else ""
                percent = improved[f"{measure}_improvement_percent"]
                findings[f"{cell}_{measure}_improvement"] = Finding(percent, why)
    return findings | _table_claims(summary, literal)


def _table_claims(summary: pd.DataFrame, literal: pd.DataFrame) -> dict[str, Finding]:
    above = (literal.error_improvement_percent > 80.0).groupby(literal.seed).mean()
    errors = summary.pivot_table(index=["seed", "path", "gain"], columns="controller", values="error_mm")
    learning = (errors["literal"] < errors["no learning"]).groupby("seed").mean()
    reduction = literal.groupby("seed")[[f"{measure}_improvement_percent" for measure in MEASURES]]
    least, most = reduction.min(), reduction.max()
    why_learning = "the gain that grows with the step does it all; learning the rest costs a little"
    why_above = "the circle is easier here than in the paper at every gain but the lowest"
    why_low = "the smallest printed one is of the circle"
    return {
        "s4d_hybrid_beats_model": Finding((least.min(axis=1) > 0.0).astype(float)),
        "s4d_learning_needed": Finding(learning, why_learning),
        "s5_error_reduction_above_80": Finding(above, why_above),
        "abstract_improvement_low": Finding(least.error_improvement_percent, why_low),
        "abstract_improvement_high": Finding(most.error_improvement_percent),
    }


def curve_findings(linear: Sequence[pd.DataFrame], fitted: Sequence[pd.DataFrame]) -> dict[str, Finding]:
    """Section IV-E from summaries of runs, one per seed, with the linear and with the fitted map."""

    def samples(runs: Sequence[pd.DataFrame], cycle: int, column: str) -> Array:
        return np.array([run.set_index("cycle").at[cycle, column] for run in runs])

    values = {
        f"linear_{name}_error_{statistic}": samples(linear, cycle, column)
        for cycle, name in ((1, "model"), (2, "hybrid"))
        for statistic, column in (("mean", "error_mm"), ("sd", "error_sd_mm"), ("max", "error_max_mm"))
    }
    for measure in MEASURES:
        values[f"spline_hybrid_{measure}_mean"] = samples(fitted, 3, f"{measure}_mm")
        values[f"spline_hybrid_{measure}_sd"] = samples(fitted, 3, f"{measure}_sd_mm")
    reduction = 1.0 - values["linear_hybrid_error_mean"] / values["linear_model_error_mean"]
    values["linear_improvement"] = 100.0 * reduction
    bent, straightened = (samples(runs, 1, "deviation_mm") for runs in (linear, fitted))
    findings = {f"s4e_{name}": Finding(value, WHY_CURVE) for name, value in values.items()}
    return findings | {"s4e_fitted_map_helps": Finding((straightened < bent).astype(float), WHY_FITTED_MAP)}


def estimation_findings(networks: pd.DataFrame, samples: pd.DataFrame) -> dict[str, Finding]:
    """Section IV-C from `estimation.compare_networks` and `estimation.initial_samples`."""
    default = networks[networks.network == "default"]
    findings = {f"s4c_elm_error_{axis}": Finding(default[f"prior_{axis}_mm"], WHY_ELM) for axis in "xyz"}
    findings["s4c_elm_error_spatial"] = Finding(default.prior_label_mm, WHY_ELM)
    findings["s4c_elm_error_spatial_after"] = Finding(default.posterior_label_mm, WHY_ELM)
    by_seed = samples.pivot(index="seed", columns="samples", values="next_mm")
    findings["s4c_more_samples_help"] = Finding((by_seed[1800] < by_seed[450]).astype(float))
    return findings


def fibre_findings(seed: int, seeds: int = 10) -> dict[str, Finding]:
    """Shift range and noise of the Appendix, and Table VII."""
    motion = spiral()
    fibres = [glue_fibre(rng) for rng in np.random.default_rng(seed).spawn(seeds)]
    spans = [1e9 * np.abs(fibre.shift(motion.configuration, motion.elongations)) for fibre in fibres]
    rng = np.random.default_rng(seed)
    noise = 1e9 * np.abs(rng.normal(0.0, FibreGratings().noise, (seeds, 17, 200)))
    findings = {
        "appendix_largest_shift": Finding([span.max() for span in spans]),
        "appendix_mean_shift": Finding([span.mean() for span in spans]),
        "appendix_static_noise_mean": Finding(noise.mean(axis=(1, 2))),
        "appendix_static_noise_max": Finding(noise.max(axis=(1, 2)), "largest of 10 s of readings"),
    }
    for statistic, shift in STATIC_SHIFTS.items():
        findings[f"appendix_static_noise_{statistic}_percent"] = Finding(100.0 * shift / SHIFT_RANGE)
    for who, shifts in TABLE_VII.items():
        for row, shift in zip(TABLE_VII_ROWS, (STATIC_SHIFTS["max"], *shifts), strict=True):
            findings[f"table7_{row}_{who}_shift"] = Finding(1e9 * shift)
            findings[f"table7_{row}_{who}_percent"] = Finding(100.0 * shift / SHIFT_RANGE)
    return findings


def fusion_findings(
    obstacles: pd.DataFrame, light: pd.DataFrame, accuracy: pd.DataFrame, motion: ArmMotion
) -> dict[str, Finding]:
    """Return the findings of Secs. IV-B and IV-C by id of the published number.

    Parameters
    ----------
    obstacles, light : DataFrame
        Runs of :func:`fuse_flights` on the flights of that disturbance, both scenes.
    accuracy : DataFrame
        As from :func:`camera_accuracy`.
    motion : ArmMotion
        The spiral.

    Returns
    -------
    dict of str to Finding
        Samples are the scenes for numbers of the camera alone, and scenes times fibres for the fusion.
    """
    reach = 1e3 * float(np.linalg.norm(motion.pose[:, :3], axis=1).max())
    step = 1e3 * np.linalg.norm(np.diff(motion.pose[:, :3], axis=0), axis=1)
    errors, light_errors = window_errors(obstacles), window_errors(light, LIGHT_WINDOWS)
    sweep = accuracy[accuracy["calibration"] == "sweep before"]
    findings = {
        **{f"s4b_slam_mae_{axis}": Finding(sweep[f"mae_{axis}_mm"], REASONS["accuracy"]) for axis in "xyz"},
        "s4b_slam_rmse": Finding(sweep["rmse_mm"], REASONS["accuracy"]),
        "s4c1_features": Finding(sweep["features"]),
        "s4c1_range": Finding(reach),
        "s4c1_first50_step": Finding(step[:999].mean()),
        "s4c1_last25_step": Finding(step[3499:].mean()),
        "s4c1_fusion_beats_slam_hand": Finding(_wins(errors, "hand in view", "mean_mm")),
        "s4c1_fusion_beats_slam_cover": Finding(_wins(errors, "full cover", "max_mm")),
        "s4c2_fusion_beats_slam": Finding(_wins(light_errors, "whole run", "rmse_mm")),
    }
    for name, estimate in (("slam", "camera"), ("fusion", "fused")):
        for label, window, statistic, reason in FINDING_ROWS:
            key, value = "s4c1_" + label.format(name), _samples(errors, window, estimate, statistic)
            findings[key] = Finding(value, REASONS[reason])
            if reason in ("hand", "cover"):
                findings[f"{key}_percent"] = Finding(100 * value / reach, REASONS[reason])
        rmse = _samples(light_errors, "whole run", estimate, "rmse_mm")
        why = REASONS.get(f"light {name}", REASONS["light"])
        findings[f"s4c2_{name}_rmse"] = Finding(rmse, REASONS["light"])
        findings[f"s4c2_{name}_rmse_percent"] = Finding(100 * rmse / reach, why)
    return findings


def _samples(errors: pd.DataFrame, window: str, estimate: str, statistic: str) -> Array:
    """Return a statistic per scene for the camera, which is one recording, else per scene and fibre."""
    rows = errors[(errors["window"] == window) & (errors["estimate"] == estimate)]
    if estimate == "camera":
        rows = rows.groupby("flight").first()
    return rows[statistic].to_numpy()


def _wins(errors: pd.DataFrame, window: str, statistic: str) -> Array:
    """Return 1 for every scene and fibre in which the fusion beats the camera, else 0."""
    rows = errors[errors["window"] == window]
    table = rows.pivot_table(index=["flight", "fibre_number"], columns="estimate", values=statistic)
    return np.asarray(table["fused"] < table["camera"], dtype=float)


def contact_findings(contacts: pd.DataFrame, counts: pd.DataFrame, seed: int) -> dict[str, Finding]:
    """Tables III, IV and VI from `collisions.sweep_contacts`."""
    findings = {}
    tables = {"push": "table3_lego", "flick": "table4"}
    for table, reason in ((contacts, WHY_CONTACT), (counts, WHY_SAMPLES)):
        for (contact, case, estimator), rows in table.groupby(["contact", "case", "estimator"]):
            kind, _, place = str(contact).partition(" ")
            cell = f"{tables[kind]}_{place}{case}" if place else f"table6_n{contact}_case{case}"
            for statistic in ("mean", "max", "sd"):
                findings[f"{cell}_{estimator}_{statistic}"] = Finding(rows[f"{statistic}_mm"], reason)
    flick = contacts[(contacts.contact == "flick body") & (contacts.estimator == "fusion")]
    findings["s4f2_peak"] = Finding(flick.groupby("seed").max_mm.max(), WHY_CONTACT)
    findings["s4f2_sd_of_second_body_case"] = Finding(flick[flick.case == 2].sd_mm, WHY_CONTACT)
    means = counts.pivot_table(index=["estimator", "seed"], columns="contact", values="mean_mm")
    for name, estimator in (("more_samples_help", "fibre"), ("samples_do_not_change_slam", "slam")):
        few, many = means.loc[[estimator], ["450", "1800"]].to_numpy().T
        findings[f"appendix_{name}"] = Finding((many < few).astype(float), WHY_SAMPLES)
    findings["s4f1_push_displacement"] = Finding(push_displacements(seed))
    return findings


def push_displacements(seed: int, seeds: int = 5) -> list[float]:
    """Largest displacement of the tip by a push on the cap, averaged over the pushes of a run [mm]."""
    free = spiral()
    displacements = []
    for rng in np.random.default_rng(seed).spawn(seeds):
        pushed, event, _ = simulate_contacts(touches()["push cap"], rng)
        distance = np.linalg.norm(pushed.pose[:, :3] - free.pose[:, :3], axis=1)
        peaks = [distance[event == number].max() for number in range(event.max() + 1)]
        displacements.append(1e3 * float(np.mean(peaks)))
    return displacements


def paper_table(summary: pd.DataFrame, path: str) -> pd.DataFrame:
    """Table I or II in the paper's layout: mean and standard deviation [mm], percent, improvement."""
    runs = summary[summary.path == path]
    means = runs.groupby(["gain", "controller"]).mean(numeric_only=True)
    better = improvements(runs).groupby(["gain", "controller"]).mean(numeric_only=True)
    rows = []
    for gain in GAINS:
        row: dict[str, float | str] = {"Kp": gain}
        for measure in MEASURES:
            for controller, name in (*CONTROLLERS.items(), ("no learning", "no learning")):
                columns = [f"{measure}_{column}" for column in STATISTICS.values()]
                mean, spread, share = means.loc[(gain, controller), columns]
                row[f"{measure}, {name}"] = f"{mean:.3f} ± {spread:.3f} ({share:.1f} %)"
            improvement = better[f"{measure}_improvement_percent"][gain, "literal"]
            row[f"{measure}, improvement"] = f"{improvement:.1f} %"
        rows.append(row)
    return pd.DataFrame(rows)


def contact_table(table: pd.DataFrame) -> pd.DataFrame:
    """Tables III, IV or VI in the paper's layout: mean, largest and spread of the errors [mm]."""
    columns = {"mean_mm": "mean", "max_mm": "max", "sd_mm": "SD"}
    groups = table.groupby(["contact", "case", "estimator"], sort=False)[list(columns)]
    return _flat(groups.mean().rename(columns=columns).unstack("estimator"))


ERRORS = r"(?P<estimator>\w+)_(?P<error>mean|max|sd)"
LAYOUTS: dict[str, tuple[str, list[str]]] = {
    "table1": (r"table1_kp(?P<Kp>\d+)_(?P<what>\w+)", ["Kp"]),
    "table2": (r"table2_kp(?P<Kp>\d+)_(?P<what>\w+)", ["Kp"]),
    "table3": (r"table3_(?P<scene>lego|abdomen)_(?P<case>[a-z]+\d)_" + ERRORS, ["scene", "error"]),
    "table4": (r"table4_(?P<case>[a-z]+\d)_" + ERRORS, ["error"]),
    "table5": (r"table5_(?P<case>[a-z]+)_" + ERRORS, ["error"]),
    "table6": (r"table6_n(?P<samples>\d+)_case(?P<case>\d)_" + ERRORS, ["error"]),
    "table7": (r"table7_(?P<shape>\w+)_(?P<fibre>bare|cover)_(?P<what>shift|percent)", ["shape"]),
}
"""Pattern of the ids of a table, and which parts of them name its rows; the others name its columns."""


def paper_beside_ours(findings: Mapping[str, Finding], table: str) -> pd.DataFrame:
    """Lay out one table of the paper with the obtained number beside every published one.

    Parameters
    ----------
    findings
        Findings by the id of the published row.
    table
        One of `LAYOUTS`.

    Returns
    -------
    pandas.DataFrame
        Cells "published / ours"; a dash where nothing was attempted.
    """
    pattern, rows = LAYOUTS[table]
    cells = []
    for number in build_scorecard("visual_strain_fusion", findings).to_dict("records"):
        if parts := re.fullmatch(pattern, str(number["id"])):
            ours = "–" if pd.isna(number["ours"]) else f"{number['ours']:.3g}"
            cells.append({**parts.groupdict(), "cell": f"{number['published']:g} / {ours}"})
    columns = [name for name in cells[0] if name not in (*rows, "cell")]
    wide = pd.DataFrame(cells).set_index([*rows, *columns])["cell"].unstack(columns, sort=False)
    return _flat(wide)


def _flat(wide: Any) -> pd.DataFrame:
    """Return a table with columns of several levels as one with a single row of names."""
    flat = wide.reset_index()
    names = [(name,) if isinstance(name, str) else name for name in flat.columns]
    flat.columns = [" ".join(str(part) for part in name if part).replace("_", " ") for name in names]
    return flat
