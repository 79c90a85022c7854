"""What decides the results: sweeps over one or two parameters of the task or the operator.

The continuous blend of manual and automatic control is the paper's own future work (Section 6); the others
ask what a sceptical reader asks. Every sweep is a plan of trials with labels and one call of `simulate`.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from soro_lib.controllers.shared_control import PARADIGMS, Paradigm
from soro_lib.papers.shared_control.experiments.demonstrations import draw_operators
from soro_lib.papers.shared_control.experiments.factorial import (
    CONTRASTS,
    DeltaReading,
    contrast_samples,
    run_factorial,
)
from soro_lib.papers.shared_control.experiments.simulation import TrialPlan, simulate
from soro_lib.papers.shared_control.experiments.task import TaskSettings
from soro_lib.papers.shared_control.world import ATTITUDES, NAIVE, Operator

KINDS = ("expert", "naive")


def person_plans(
    settings: TaskSettings, people: Sequence[Operator], seed: int, trials: int, labels: dict[str, Any]
) -> Iterator[TrialPlan]:
    """Every person for a few trials under one setting; chance is shared between settings."""
    for person, operator in enumerate(people):
        for trial in range(trials):
            yield TrialPlan(
                settings, operator, (seed, 4, person, trial), {**labels, "operator": person, "trial": trial}
            )


def blend_surface(
    operators: int, seed: int, shares: Sequence[float], kinds: Sequence[str] = KINDS, **run: Any
) -> pd.DataFrame:
    """Continuous blend: the machine's shares in steering and in eversion, each from manual to automatic.

    Parameters
    ----------
    operators : int
        People per kind.
    seed : int
    shares : sequence of float
        Shares of the machine to combine, in [0, 1].
    kinds : sequence of str
    **run
        jobs, scheduler or store of `simulate`.

    Returns
    -------
    pandas.DataFrame
        One line per trial; labels kind, steering, eversion, operator, trial.
    """

    def plans() -> Iterator[TrialPlan]:
        for kind in kinds:
            people = draw_operators(kind, operators, seed)
            for steering in shares:
                for eversion in shares:
                    paradigm = Paradigm("Blend", (steering, steering, eversion))
                    labels = {"kind": kind, "steering": steering, "eversion": eversion}
                    yield from person_plans(TaskSettings(paradigm), people, seed, 1, labels)

    return simulate(plans(), **run)


def misdetection_cost(operators: int, seed: int, offsets: Sequence[float], **run: Any) -> pd.DataFrame:
    """The machine is told goals that lie ``offsets`` [m] beside the true ones (along x); the operator sees.

    Returns
    -------
    pandas.DataFrame
        One line per trial; labels kind, paradigm, offset_mm, operator, trial.
    """

    def plans() -> Iterator[TrialPlan]:
        for kind in KINDS:
            people = draw_operators(kind, operators, seed)
            for name, paradigm in PARADIGMS.items():
                for offset in offsets:
                    settings = TaskSettings(paradigm, detection_error=(offset, 0.0, 0.0))
                    labels = {"kind": kind, "paradigm": name, "offset_mm": 1e3 * offset}
                    yield from person_plans(settings, people, seed, 1, labels)

    return simulate(plans(), time_limit=120.0, **run)


def tracking_noise_effect(operators: int, seed: int, noises: Sequence[float], **run: Any) -> pd.DataFrame:
    """Assist-as-needed on the real arm with noisier tracking [m]; th_M is tested on single samples.

    Returns
    -------
    pandas.DataFrame
        One line per trial; labels kind, counter, noise_mm, operator, trial.
    """

    def plans() -> Iterator[TrialPlan]:
        people = draw_operators("naive", operators, seed)
        for counter in ("text", "caption"):
            for noise in noises:
                settings = TaskSettings(
                    PARADIGMS["assist_as_needed"],
                    environment="real",
                    assist_as_needed={"counter": counter},
                    tracking_noise=noise,
                )
                labels = {"kind": "naive", "counter": counter, "noise_mm": 1e3 * noise}
                yield from person_plans(settings, people, seed, 1, labels)

    return simulate(plans(), **run)


def dwell_effect(operators: int, seed: int, dwells: Sequence[float], **run: Any) -> pd.DataFrame:
    """Naive users who wait ``dwells`` [s] before they press, with assist-as-needed and without.

    Returns
    -------
    pandas.DataFrame
        One line per trial; labels paradigm, attitude, dwell_s, operator, trial.
    """

    def plans() -> Iterator[TrialPlan]:
        people = draw_operators("naive", operators, seed)
        for name in ("full_teleoperation", "assist_as_needed"):
            settings = TaskSettings(PARADIGMS[name])
            for attitude in ("ignore", "use"):
                for dwell in dwells:
                    changed = [replace(person, dwell=dwell, **ATTITUDES[attitude]) for person in people]
                    labels = {"paradigm": name, "attitude": attitude, "dwell_s": dwell}
                    yield from person_plans(settings, changed, seed, 2, labels)

    return simulate(plans(), **run)


def lift_effect(operators: int, seed: int, **run: Any) -> pd.DataFrame:
    """Mostly autonomous with and without its compulsory lifts, beside the paradigms that share control.

    Returns
    -------
    pandas.DataFrame
        One line per trial; labels kind, case, operator, trial.
    """
    cases = {
        "Mostly autonomous": TaskSettings(PARADIGMS["mostly_autonomous"]),
        "without lifts": TaskSettings(PARADIGMS["mostly_autonomous"], lift=False),
        "MSAE": TaskSettings(PARADIGMS["msae"]),
        "ASME": TaskSettings(PARADIGMS["asme"]),
    }

    def plans() -> Iterator[TrialPlan]:
        for kind in KINDS:
            people = draw_operators(kind, operators, seed)
            for case, settings in cases.items():
                yield from person_plans(settings, people, seed, 2, {"kind": kind, "case": case})

    return simulate(plans(), **run)


def passivity_effect(
    seed: int,
    passivities: Sequence[float],
    repetitions: int,
    reading: DeltaReading = "seconds",
    **run: Any,
) -> pd.DataFrame:
    """Effects of the tuning study in ever more passive operators, who yield and tolerate more.

    Passivity rho runs together with a yield time of 3 s and a tolerance of 40 mm wherever rho is not zero.

    Returns
    -------
    pandas.DataFrame
        Columns passivity, contrast, effect, low, high (95 % over repetitions, normal), mean_time_s.
    """
    rows = []
    for passivity in passivities:
        changes = {"passivity": passivity, "yield_time": 3.0, "tolerance": 0.04} if passivity > 0 else {}
        trials = run_factorial([replace(NAIVE, **changes)], seed, repetitions, reading, **run)
        for contrast in CONTRASTS:
            samples = contrast_samples(trials, contrast)[0]
            spread = 1.96 * samples.std(ddof=1) / np.sqrt(len(samples))
            rows.append(
                {
                    "passivity": passivity,
                    "contrast": contrast.name,
                    "effect": samples.mean(),
                    "low": samples.mean() - spread,
                    "high": samples.mean() + spread,
                    "mean_time_s": trials["time_s"].mean(),
                }
            )
    return pd.DataFrame(rows)
