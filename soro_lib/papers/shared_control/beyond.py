"""What the paper leaves open: sweeps, anyone at the controls, and the stability of the guided hand.

The continuous blend of manual and automatic control is the paper's own future work (Section 6); the others
ask what a sceptical reader asks. The paper reports no instability and no bound on the guidance.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pandas as pd
from scipy.optimize import brentq
from scipy.stats import qmc, spearmanr

from soro_lib.checks import not_negative, positive
from soro_lib.controllers.shared_control import PARADIGMS, Paradigm
from soro_lib.papers.shared_control.experiments.claims import operator_means
from soro_lib.papers.shared_control.experiments.demonstrations import KINDS, draw_operators
from soro_lib.papers.shared_control.experiments.factorial import CONTRASTS, contrast_samples, run_factorial
from soro_lib.papers.shared_control.experiments.simulation import TrialPlan, person_plans, simulate
from soro_lib.papers.shared_control.experiments.task import TaskSettings
from soro_lib.papers.shared_control.world.people import ATTITUDES, DEVICE_SCALE, EXPERT, NAIVE, Operator
from soro_lib.papers.shared_control.world.plant import PlantParameters

# --- Sweeps over one or two parameters of the task or the operator ------------------------------------------

Case = tuple[TaskSettings, Sequence[Operator]]
"""A task, and who does it."""


def sweep(
    case: Callable[..., Case],
    seed: Sequence[int],
    trials: int,
    run: Mapping[str, Any],
    /,
    **factors: Iterable[Any],
) -> pd.DataFrame:
    """Simulate every combination of the factors; all of them meet the same chance.

    Parameters
    ----------
    case : callable
        Takes one value of each factor by name.
    seed : sequence of int
        Entropy of the sweep.
    trials : int
        Of every person in every case.
    run : mapping
        time_limit, jobs, scheduler or store of `simulate`.
    **factors
        Values of each factor, the first varies slowest.

    Returns
    -------
    pandas.DataFrame
        One line per trial: the factors, operator, trial, metrics.
    """

    def plans() -> Iterator[TrialPlan]:
        for values in product(*factors.values()):
            labels = dict(zip(factors, values, strict=True))
            yield from person_plans(*case(**labels), seed, trials, labels)

    return simulate(plans(), **run)


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

    def case(kind: str, steering: float, eversion: float) -> Case:
        blend = Paradigm("Blend", (steering, steering, eversion))
        return TaskSettings(blend), draw_operators(kind, operators, seed)

    return sweep(case, (seed, 4), 1, run, kind=kinds, steering=shares, eversion=shares)


def misdetection_cost(operators: int, seed: int, offsets: Sequence[float], **run: Any) -> pd.DataFrame:
    """The machine is told goals that lie ``offsets`` [m] beside the true ones (along x); the operator sees.

    Returns
    -------
    pandas.DataFrame
        One line per trial; labels kind, paradigm, offset_mm, operator, trial.
    """

    def case(kind: str, paradigm: str, offset_mm: float) -> Case:
        settings = TaskSettings(PARADIGMS[paradigm], detection_error=(offset_mm / 1e3, 0.0, 0.0))
        return settings, draw_operators(kind, operators, seed)

    run = {"time_limit": 120.0, **run}
    millimetres = [1e3 * offset for offset in offsets]
    return sweep(case, (seed, 4), 1, run, kind=KINDS, paradigm=PARADIGMS, offset_mm=millimetres)


def tracking_noise_effect(operators: int, seed: int, noises: Sequence[float], **run: Any) -> pd.DataFrame:
    """Assist-as-needed on the real arm with noisier tracking [m]; th_M is tested on single samples.

    Returns
    -------
    pandas.DataFrame
        One line per trial; labels kind, counter, noise_mm, operator, trial.
    """
    real = TaskSettings(PARADIGMS["assist_as_needed"], environment="real")

    def case(kind: str, counter: str, noise_mm: float) -> Case:
        settings = replace(real, assist_as_needed={"counter": counter}, tracking_noise=noise_mm / 1e3)
        return settings, draw_operators(kind, operators, seed)

    millimetres = [1e3 * noise for noise in noises]
    counters = ("text", "caption")
    return sweep(case, (seed, 4), 1, run, kind=["naive"], counter=counters, noise_mm=millimetres)


def dwell_effect(operators: int, seed: int, dwells: Sequence[float], **run: Any) -> pd.DataFrame:
    """Naive users who wait ``dwells`` [s] before they press, with assist-as-needed and without.

    Returns
    -------
    pandas.DataFrame
        One line per trial; labels paradigm, attitude, dwell_s, operator, trial.
    """

    def case(paradigm: str, attitude: str, dwell_s: float) -> Case:
        people = draw_operators("naive", operators, seed, dwell=dwell_s, **ATTITUDES[attitude])
        return TaskSettings(PARADIGMS[paradigm]), people

    paradigms = ("full_teleoperation", "assist_as_needed")
    return sweep(case, (seed, 4), 2, run, paradigm=paradigms, attitude=("ignore", "use"), dwell_s=dwells)


def lift_effect(operators: int, seed: int, **run: Any) -> pd.DataFrame:
    """Mostly autonomous with and without its compulsory lifts, beside the paradigms that share control.

    Returns
    -------
    pandas.DataFrame
        One line per trial; labels kind, case, operator, trial.
    """
    tasks = {
        "Mostly autonomous": TaskSettings(PARADIGMS["mostly_autonomous"]),
        "without lifts": TaskSettings(PARADIGMS["mostly_autonomous"], lift=False),
        "MSAE": TaskSettings(PARADIGMS["msae"]),
        "ASME": TaskSettings(PARADIGMS["asme"]),
    }

    def chosen(kind: str, case: str) -> Case:
        return tasks[case], draw_operators(kind, operators, seed)

    return sweep(chosen, (seed, 4), 2, run, kind=KINDS, case=tasks)


def passivity_effect(seed: int, passivities: Sequence[float], repetitions: int, **run: Any) -> pd.DataFrame:
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
        trials = run_factorial([replace(NAIVE, **changes)], seed, repetitions, **run)
        for contrast in CONTRASTS:
            samples = contrast_samples(trials, contrast)[0]
            effect, spread = samples.mean(), 1.96 * samples.std(ddof=1) / np.sqrt(len(samples))
            interval = (effect, effect - spread, effect + spread)
            rows.append((passivity, contrast.name, *interval, trials["time_s"].mean()))
    return pd.DataFrame(rows, columns=["passivity", "contrast", "effect", "low", "high", "mean_time_s"])


# --- Which conclusions depend on the operator: rank correlations over a Latin hypercube ---------------------

RANGES: Mapping[str, tuple[float, float]] = {
    "reaction_delay": (0.15, 0.40),
    "refractory": (0.2, 0.8),
    "submovement_time": (0.3, 0.7),
    "lag_model": (0.0, 1.0),
    "wait_speed": (0.01, 0.3),
    "gain_factor": (0.6, 1.6),
    "mapping_angle": (0.0, 0.5),
    "motor_noise": (0.02, 0.2),
    "lateral_error": (0.002, 0.015),
    "depth_error": (0.005, 0.1),
    "tolerance": (0.008, 0.03),
    "dwell": (0.2, 2.0),
    "think": (0.2, 1.5),
    "hand_stiffness": (80.0, 500.0),
    "cue_gain": (0.0, 0.04),
    "approach_height": (0.0, 0.15),
    "view_elevation": (math.radians(15.0), math.radians(60.0)),
}
"""Least and largest value of each parameter of `Operator`, far wider than the populations: from a developer
of the arm to somebody who has never seen it."""


def draw_anyone(count: int, seed: int) -> list[Operator]:
    """Operators of a Latin hypercube over `RANGES`."""
    sampler = qmc.LatinHypercube(len(RANGES), rng=np.random.default_rng([seed, 5]))
    low, high = np.array(list(RANGES.values())).T
    points = qmc.scale(sampler.random(count), low, high)
    return [replace(EXPERT, **dict(zip(RANGES, point.tolist(), strict=True))) for point in points]


def margins(trials: pd.DataFrame) -> pd.DataFrame:
    """How clearly each conclusion holds for each operator: logarithms of ratios, positive where it holds."""
    means = operator_means(trials)
    time, error, force = np.log(means["time_s"]), np.log(means["release_error_mm"]), means["assistance_n"]
    full, aan, fixed, msae, asme, auto = PARADIGMS
    others = [full, aan, fixed, msae, asme]
    return pd.DataFrame(
        {
            "Auto shortest": time[others].min(axis=1) - time[auto],
            "Auto most accurate": error[others].min(axis=1) - error[auto],
            "ASME shorter than MSAE": time[msae] - time[asme],
            "ASME more accurate": error[msae] - error[asme],
            "MSAE shorter than Full": time[full] - time[msae],
            "AAN shorter than Full": time[full] - time[aan],
            "AAN more accurate": error[full] - error[aan],
            "AAN shorter than Fixed": time[fixed] - time[aan],
            "Fixed slower than MSAE": time[fixed] - time[msae],
            "Force of AAN": force[aan],
        }
    )


def sensitivity(count: int, seed: int, trials: int = 2, **run: Any) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Simulate anyone and correlate the margins with the parameters.

    Parameters
    ----------
    count : int
        Operators.
    seed : int
    trials : int
        Of each operator under each paradigm.
    **run
        jobs, scheduler or store of `simulate`.

    Returns
    -------
    correlations : pandas.DataFrame
        Spearman's rank correlation, one line per parameter and one column per conclusion.
    held : pandas.DataFrame
        One line per conclusion: share of operators for whom it holds, with a 95 % interval (normal).
    """
    people = draw_anyone(count, seed)

    def case(paradigm: str) -> Case:
        return TaskSettings(PARADIGMS[paradigm]), people

    run = {"time_limit": 120.0, **run}
    results = margins(sweep(case, (seed, 6), trials, run, paradigm=PARADIGMS))
    parameters = [[getattr(person, name) for person in people] for name in RANGES]
    correlations = {
        name: [spearmanr(values, margin, nan_policy="omit").statistic for values in parameters]
        for name, margin in results.items()
    }
    share = (results.drop(columns="Force of AAN") > 0).mean()
    spread = 1.96 * np.sqrt(share * (1 - share) / count)
    held = pd.DataFrame({"probability": share, "low": share - spread, "high": share + spread})
    return pd.DataFrame(correlations, index=list(RANGES)), held.rename_axis("conclusion").reset_index()


# --- How stiff the guidance may be before hand and arm swing against each other -----------------------------
#
# The guidance closes a loop: the force moves the hand, the hand's motion times the device's scale moves the
# tip after its lag, and the tip changes the force. The hand is passive here (mass, damper, spring); a person
# who corrects on top of it is in the simulations.

AXES = {"x": DEVICE_SCALE[0], "z": DEVICE_SCALE[2]}
"""Scale of steering and eversion [-]."""


def critical_stiffness(hand_stiffness: float, delay: float = 0.0, scale: float = DEVICE_SCALE[2]) -> float:
    """Guidance stiffness at which the passive hand starts to oscillate [N/m].

    The loop k G e^(-s tau) / ((m s^2 + b s + k_h) (T s + 1)) is cut where its phase is -180 degrees; m and b
    are those of the expert's hand, T is the lag of the simulated tip.

    Parameters
    ----------
    hand_stiffness : float
        k_h [N/m].
    delay : float
        tau, between hand and tip or tip and force [s].
    scale : float
        G, tip displacement per hand displacement [-].

    Raises
    ------
    ValueError
        If the hand's stiffness or the scale is not positive, or the delay negative.
    """
    positive("hand_stiffness", hand_stiffness)
    positive("scale", scale)
    not_negative("delay", delay)
    mass, damping, lag = EXPERT.hand_mass, EXPERT.hand_damping, PlantParameters.tip_lag

    def phase_margin(frequency: float) -> float:
        hand = math.atan2(damping * frequency, hand_stiffness - mass * frequency**2)
        return math.pi - hand - math.atan(lag * frequency) - delay * frequency

    crossover = brentq(phase_margin, 1e-6, 1e4)
    hand = complex(hand_stiffness - mass * crossover**2, damping * crossover)
    return abs(hand * complex(1.0, lag * crossover)) / scale


def passive_stiffness(delay: float = 0.0, scale: float = DEVICE_SCALE[2]) -> float:
    """Guidance stiffness up to which hand and guidance together dissipate at every frequency [N/m].

    The guidance, seen from the hand, is k G e^(-s tau) / (s (T s + 1)): its real part is negative, most so at
    low frequencies, where it tends to -k G (T + tau). Passive while the hand's damping covers that.
    """
    return EXPERT.hand_damping / (scale * (PlantParameters.tip_lag + delay))


def stability_map(hand_stiffness: Iterable[float], delays: Sequence[float]) -> pd.DataFrame:
    """Critical stiffness over hand stiffness and delay for steering and eversion.

    Returns
    -------
    pandas.DataFrame
        Columns axis, delay_s, hand_stiffness_n_per_m, critical_stiffness_n_per_m, passive_stiffness_n_per_m.
    """
    rows = [
        (axis, delay, hand, critical_stiffness(hand, delay, scale), passive_stiffness(delay, scale))
        for axis, scale in AXES.items()
        for delay in delays
        for hand in hand_stiffness
    ]
    stiffness = ["hand_stiffness_n_per_m", "critical_stiffness_n_per_m", "passive_stiffness_n_per_m"]
    return pd.DataFrame(rows, columns=["axis", "delay_s", *stiffness])
