"""Pushes and flicks: camera and fibre disturbed at once (Wang et al., Sec. IV-F and Appendix).

Stated causes, no injected error. A force bends the backbone away from the shapes that the network was
trained on: the fibre sees the true curvature, but the network extrapolates. A finger on the body presses on
the gratings under it, by the shifts of Table VII. A fast motion blurs the image until the features are lost
and the camera holds its last pose.

Calibrated: the force of the push (15 mm at the tip) and the squeeze of a grating (Table VII). Assumed: shape,
decay, frequency and force of the flick, exposure of the camera. Everything else is predicted.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from soro_lib.estimators.extreme_learning_machine import ExtremeLearningMachine
from soro_lib.estimators.visual_strain import VisualStrainEstimator, VisualStrainSettings
from soro_lib.papers.visual_strain_fusion.experiments.estimation import LABEL_NOISE
from soro_lib.papers.visual_strain_fusion.world.fibre import FibreGratings
from soro_lib.papers.visual_strain_fusion.world.motion import (
    PERIOD,
    ArmMotion,
    glue_fibre,
    move,
    spiral_bending,
)
from soro_lib.papers.visual_strain_fusion.world.plant import Array, BackboneParameters

TABLE_VII = {
    "bare": 1e-9 * np.array([0.0765, 0.0910, 0.0922, 0.0911, 0.0729, 0.0903]),
    "cover": 1e-9 * np.array([0.0387, 0.0319, 0.0151, 0.0145, 0.0189, 0.0202]),
}
"""Input: largest shifts of a grating under a finger push, straight and curved, bare and covered [m]."""

STATIONS = {"cap": 1.0, "body": 0.5}
"""Where the finger meets the arm, as a share of its length."""

PUSH_TIME = 4.0
FLICK_DECAY = 0.35
FLICK_FREQUENCY = 3.0
EVERY = 8.0
FIRST = 110.0
"""Shape of the contacts in time [s, Hz]."""

EXPOSURE = 1.0 / 60.0
PIXELS_PER_RADIAN = 520.0
SCENE_DISTANCE = 0.1
LARGEST_BLUR = 15.0
"""The camera under motion blur: exposure [s], focal length [px], distance of the scene [m], and the blur at
which the features are lost [px]."""


@dataclass(frozen=True)
class Contact:
    """A kind of contact that is repeated every 8 s from 110 s on, from random sides.

    Attributes
    ----------
    kind : str
        "push" or "flick".
    place : str
        "cap" or "body".
    fibre : str
        "bare" or "cover".
    force : float
        Bending by the force at the cap [1/m^2]; 15 mm of tip motion for the default.
    masking : bool
        Whether the estimator sets aside gratings that disagree with the others.
    initial_samples : int
        Samples N0 of the first solution.
    blind : bool
        Whether the view is covered during the contacts, so that the fibre stands alone.
    """

    kind: str
    place: str
    fibre: str = "bare"
    force: float = 5.25
    masking: bool = False
    initial_samples: int = 450
    blind: bool = False

    def __post_init__(self) -> None:
        """Check the values; the error names the field and what is allowed."""
        allowed = {"kind": ("push", "flick"), "place": tuple(STATIONS), "fibre": tuple(TABLE_VII)}
        for name, values in allowed.items():
            if getattr(self, name) not in values:
                raise ValueError(f"{name} must be one of {values}, got {getattr(self, name)!r}")
        if not 0.0 < self.force < 1e4:
            raise ValueError(f"force must lie in (0, 1e4), got {self.force}")


@dataclass(frozen=True)
class ContactRun:
    """Record of one run with contacts; ``n`` steps.

    Attributes
    ----------
    motion : ArmMotion
        What the arm did.
    event : ndarray (n,)
        Number of the contact that a step belongs to, -1 for none.
    positions : dict of ndarray (n, 3)
        Estimated positions by "slam", "fibre" and "fusion" [m].
    lost : ndarray (n,) of bool
        Where the camera had lost its features.
    """

    motion: ArmMotion
    event: NDArray[np.int64]
    positions: dict[str, Array]
    lost: NDArray[np.bool_]

    def errors(self) -> dict[str, Array]:
        """Distances from the true position by estimator, ``(n,)`` each [m]."""
        truth = self.motion.pose[:, :3]
        return {name: np.linalg.norm(position - truth, axis=1) for name, position in self.positions.items()}


def force_profile(kind: str, time: Array) -> Array:
    """Force over time since the contact began, 1 at most: a slow push or a decaying swing after a flick."""
    if kind == "push":
        return np.where((time >= 0.0) & (time < PUSH_TIME), np.sin(np.pi * time / PUSH_TIME) ** 2, 0.0)
    swing = np.exp(-time / FLICK_DECAY) * np.cos(2.0 * np.pi * FLICK_FREQUENCY * time)
    return np.where((time >= 0.0) & (time < 8.0 * FLICK_DECAY), swing, 0.0)


def simulate_contacts(
    contact: Contact, rng: np.random.Generator, steps: int = 4000
) -> tuple[ArmMotion, NDArray[np.int64], Array]:
    """Let the arm follow the spiral while it is touched.

    Returns
    -------
    motion : ArmMotion
        What the arm does.
    event : ndarray (steps,)
        Number of the contact, -1 for none.
    squeeze : ndarray (steps, gratings)
        Share of a full squeeze on every grating, 0 to 1 [-].
    """
    time = PERIOD * np.arange(steps)
    starts = np.arange(FIRST, time[-1] - PUSH_TIME, EVERY)
    sides = rng.uniform(0.0, 2.0 * np.pi, len(starts))
    fibre, backbone = FibreGratings(), BackboneParameters()
    force, event = np.zeros((steps, 2)), np.full(steps, -1, dtype=np.int64)
    squeeze = np.zeros((steps, fibre.gratings))
    for number, (start, side) in enumerate(zip(starts, sides)):
        profile = force_profile(contact.kind, time - start)
        force += contact.force * profile[:, None] * np.array([np.cos(side), np.sin(side)])
        event[(time >= start) & (time < start + EVERY / 2.0)] = number
        if contact.place == "body":
            # A push lasts, a flick touches only at its very beginning.
            touching = profile if contact.kind == "push" else np.where(profile > 0.8, profile, 0.0)
            squeeze += _under_finger(fibre, side) * np.maximum(touching, 0.0)[:, None]
    curvature = backbone.contact_curvature(force, np.full(steps, STATIONS[contact.place]))
    return move(spiral_bending(steps), backbone, curvature), event, squeeze


def _under_finger(fibre: FibreGratings, side: float) -> Array:
    """Share of the squeeze that every grating takes, from where the finger lies on the body.

    The finger covers 8 mm up and down, and 0.6 rad to either side.
    """
    height = (fibre.height - STATIONS["body"] * fibre.length) / 8e-3
    # The finger pushes toward `side`, so it lies on the opposite side of the body.
    around = (fibre.azimuth - side) % (2.0 * np.pi) - np.pi
    return np.maximum(0.0, 1.0 - height**2) * np.maximum(0.0, 1.0 - (around / 0.6) ** 2)


def motion_blur(motion: ArmMotion) -> Array:
    """Length of the blur per step, ``(n,)`` [px]: image speed times exposure."""
    speed = np.linalg.norm(np.gradient(motion.pose[:, :3], PERIOD, axis=0), axis=1)
    cosine = np.abs(np.sum(motion.pose[1:, 3:] * motion.pose[:-1, 3:], axis=1)).clip(max=1.0)
    turning = np.concatenate([[0.0], 2.0 * np.arccos(cosine) / PERIOD])
    return np.asarray(EXPOSURE * PIXELS_PER_RADIAN * (speed / SCENE_DISTANCE + turning))


def run_contacts(contact: Contact, rng: np.random.Generator, steps: int = 4000) -> ContactRun:
    """Estimate the pose through a run with contacts, learning on.

    Parameters
    ----------
    contact : Contact
        What touches the arm, and how the estimator is set.
    rng : numpy.random.Generator
        Draws sides and strengths of the contacts, the bonds of the fibre, the network and all noise.
    steps : int
        Samples of 0.05 s.
    """
    motion, event, squeeze = simulate_contacts(contact, rng, steps)
    fibre = glue_fibre(rng)
    strength = rng.choice(TABLE_VII[contact.fibre], squeeze.shape[1])
    shifts = fibre.shift(motion.configuration, motion.elongations, rng) + strength * squeeze
    blur = motion_blur(motion)
    lost = (blur > LARGEST_BLUR) | (contact.blind & (event >= 0))
    seen = motion.pose.copy()
    # Features are found less precisely along a blur; half its length is what the tracker cannot know.
    spread = np.asarray(LABEL_NOISE) * np.sqrt(1.0 + (blur[:, None] / 4.0) ** 2)
    seen[:, :3] += rng.normal(0.0, 1.0, (steps, 3)) * spread
    mask = fibre.noise if contact.masking else 0.0
    settings = VisualStrainSettings(initial_samples=contact.initial_samples, grating_noise=mask)
    estimator = VisualStrainEstimator(ExtremeLearningMachine(rng), settings)
    positions = {name: np.empty((steps, 3)) for name in ("slam", "fibre", "fusion")}
    for step in range(steps):
        found = None if lost[step] else seen[step]
        inliers = 300.0 / (1.0 + blur[step] / 4.0)
        estimate = estimator.update(motion.time[step], shifts[step], found, 1.0, inliers)
        for name, pose in zip(positions, (estimate.camera_pose, estimate.fibre_pose, estimate.pose)):
            positions[name][step] = pose[:3]
    return ContactRun(motion, event, positions, lost)


def summarise_contacts(run: ContactRun) -> pd.DataFrame:
    """Errors while touched, by estimator and case: columns estimator, case, mean_mm, max_mm, sd_mm.

    Case 1 are the contacts of the first half of the journey, case 2 those of the second half.
    """
    middle = (run.event.max() + 1) // 2
    cases = {1: (run.event >= 0) & (run.event < middle), 2: run.event >= middle}
    rows = []
    for name, error in run.errors().items():
        for case, chosen in cases.items():
            values = 1e3 * error[chosen]
            rows.append((name, case, values.mean(), values.max(), values.std()))
    return pd.DataFrame(rows, columns=["estimator", "case", "mean_mm", "max_mm", "sd_mm"])


def sweep_contacts(seed: int, contacts: dict[str, Contact], *, seeds: int = 5) -> pd.DataFrame:
    """Summaries of several contacts over seeds; contacts of one seed come from the same sides.

    Returns
    -------
    pandas.DataFrame
        Columns contact, seed and those of `summarise_contacts`.
    """
    tables = []
    for name, contact in contacts.items():
        for number, rng in enumerate(np.random.default_rng(seed).spawn(seeds)):
            run = run_contacts(contact, rng)
            tables.append(summarise_contacts(run).assign(contact=name, seed=number))
    return pd.concat(tables, ignore_index=True)


def touches() -> dict[str, Contact]:
    """The four contacts of Tables III and IV: slow push and fast flick, on cap and body, bare fibre."""
    return {f"{kind} {place}": Contact(kind, place) for kind in ("push", "flick") for place in STATIONS}


def sample_counts(counts: Sequence[int] = (450, 900, 1800)) -> dict[str, Contact]:
    """The identical flick on the cap for different numbers of initial samples (Table VI)."""
    return {str(count): Contact("flick", "cap", initial_samples=count) for count in counts}


def protections() -> dict[str, Contact]:
    """The slow push on the body with the view covered: bare, sheathed, and with contact masking."""
    bare = Contact("push", "body", blind=True)
    covered = replace(bare, fibre="cover")
    return {
        "bare": bare,
        "silicone cover": covered,
        "bare, masked": replace(bare, masking=True),
        "silicone cover, masked": replace(covered, masking=True),
    }
