"""Beyond the paper: reach, a fist that keeps its direction, delay against rate, error ellipses."""

from __future__ import annotations

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.interpolate import RegularGridInterpolator

from soro_lib.controllers.gesture_steering import SteeringSettings
from soro_lib.controllers.hand_mapping import PalmMapping
from soro_lib.controllers.steering_step import StepBounds, StepWeights, pose_step, solve
from soro_lib.papers.gesture_steering.experiments import steering
from soro_lib.papers.gesture_steering.experiments.steering import ServoBus, commanding_hand
from soro_lib.papers.gesture_steering.world.hand import QUIET
from soro_lib.robots import CableDrivenArm
from soro_lib.robots.cable_driven_kernels import compiled_kinematics

Array = NDArray[np.float64]


def reached(
    arm: CableDrivenArm, positions: Array, directions: Array, iterations: int = 40
) -> tuple[Array, Array]:
    """Return how close the arm comes to poses: distances (n,) [m] and angles (n,) [rad], by repeated Eq.
    (26).

    Local solves from two starts: "not reached" means "not found".

    Parameters
    ----------
    arm : CableDrivenArm
        The arm.
    positions, directions : ndarray (n, 3)
        Wanted tips [m] and unit pointing directions.
    iterations : int
        Linearised steps per start [-].
    """
    kinematics = compiled_kinematics(arm)
    weights = StepWeights(damping=0.1)
    found = np.full((len(positions), 2), np.inf)
    for index, (position, direction) in enumerate(zip(positions, directions)):
        for tension in (0.05, 0.8):
            actuation = np.array([np.clip(position[2] - 0.09, 0.0, arm.slide_length), *[-tension] * 6])
            for _ in range(iterations):
                pose = kinematics(actuation)
                wanted = np.clip(position - pose.tip, -0.02, 0.02)
                lower = np.maximum(arm.lower - actuation, -np.array([0.02, *[0.5] * 6]))
                upper = np.minimum(arm.upper - actuation, np.array([0.02, *[0.5] * 6]))
                step = solve(
                    pose_step(pose, wanted, direction - pose.direction, StepBounds(lower, upper), weights)
                )
                actuation = np.clip(actuation + step.actuation_step, arm.lower, arm.upper)
                if np.abs(step.actuation_step).max() < 1e-5:
                    break
            pose = kinematics(actuation)
            error = np.linalg.norm(pose.tip - position), np.linalg.norm(pose.direction - direction)
            found[index] = min(tuple(found[index]), error, key=lambda pair: pair[0] + 0.05 * pair[1])
    return found[:, 0], found[:, 1]


def reach_map(
    heights: Array, radii: Array, tilts: Array, azimuths: int = 6, arm: CableDrivenArm | None = None
) -> pd.DataFrame:
    """Find the largest tilt that the tip can take towards every azimuth.

    Parameters
    ----------
    heights, radii : ndarray
        Tip heights and distances from the axis [m].
    tilts : ndarray
        Tilts that are tried, ascending [rad].
    azimuths : int
        Directions of tilt, relative to the tip's own azimuth [-].
    arm : CableDrivenArm, optional
        The arm.

    Returns
    -------
    DataFrame
        ``z_mm``, ``radius_mm``, ``tilt_deg``: largest tilt reached within 0.5 mm and 1 deg towards every
        azimuth; NaN where not even a straight tip is.
    """
    arm = arm or CableDrivenArm()
    rows = []
    for height in heights:
        for radius in radii:
            best = np.nan
            for tilt in tilts:
                around = 2 * np.pi * np.arange(azimuths if tilt > 0 else 1) / azimuths
                directions = np.column_stack(
                    [
                        np.sin(tilt) * np.cos(around),
                        np.sin(tilt) * np.sin(around),
                        np.full_like(around, np.cos(tilt)),
                    ]
                )
                positions = np.tile([radius, 0.0, height], (len(around), 1))
                distance, angle = reached(arm, positions, directions)
                if (distance > 0.5e-3).any() or (angle > np.deg2rad(1.0)).any():
                    break
                best = tilt
            rows.append((height * 1e3, radius * 1e3, np.degrees(best)))
    return pd.DataFrame(rows, columns=["z_mm", "radius_mm", "tilt_deg"])


def mapping_choice(reach: pd.DataFrame, scales: tuple[float, ...] = (-0.05, -0.1, -0.15, -0.2),
                   offsets: tuple[float, ...] = (0.150, 0.165)) -> pd.DataFrame:  # fmt: skip
    """Judge choices of c_z and offset by what share of the allowed box the arm can serve.

    Parameters
    ----------
    reach : DataFrame
        From :func:`reach_map`.
    scales : tuple of float
        c_z [-].
    offsets : tuple of float
        [m].

    Returns
    -------
    DataFrame
        ``scale_z``, ``offset_mm``, ``z_low_mm``, ``z_high_mm``, ``straight`` (share of the box with a
        reachable straight tip), ``tilt_20`` (share where every tilt up to 20 deg is), ``clamp_deg`` (tilt
        reachable in 90 % of the box).
    """
    grid = reach.pivot(index="z_mm", columns="radius_mm", values="tilt_deg").fillna(-10.0)
    side = np.linspace(-0.15, 0.15, 13)
    x, z = (axis.ravel() for axis in np.meshgrid(side, side))
    rows = []
    for offset in offsets:
        for scale in scales:
            mapping = PalmMapping(scale_z=scale, offset=offset)
            palms = np.linspace(mapping.lowest, mapping.highest, 13)
            tips = np.array([mapping.position((a, b, c)) for b in palms for a, c in zip(x, z)]) * 1e3
            tilt = _interpolated(grid, tips[:, 2], np.hypot(tips[:, 0], tips[:, 1]))
            low, high = tips[:, 2].min(), tips[:, 2].max()
            clamp = max(float(np.percentile(tilt, 10)), 0.0)
            rows.append(
                (scale, offset * 1e3, low, high, np.mean(tilt >= 0), np.mean(tilt >= 20 - 1e-9), clamp)
            )
    columns = ["scale_z", "offset_mm", "z_low_mm", "z_high_mm", "straight", "tilt_20", "clamp_deg"]
    return pd.DataFrame(rows, columns=columns)


REACH_AWARE = PalmMapping(maximum_tilt=np.deg2rad(40.0), tilt_loss=np.deg2rad(40.0) / 0.040)
"""The largest tilt of the reach map: 40 degrees on the axis, one degree less per millimetre beside it."""


def clamp_study(table: pd.DataFrame) -> pd.DataFrame:
    """Compare a constant tilt limit with the reach-aware one on a recording.

    Returns
    -------
    DataFrame
        ``limit``, mean, 95 % and largest ``position_*_mm`` and ``direction_*_deg`` between tip and target
        outside the fist, and ``asked_deg``: mean tilt that is asked for.
    """
    rows = []
    for name, mapping in (
        ("30 deg everywhere", PalmMapping()),
        ("15 deg everywhere", PalmMapping(maximum_tilt=np.deg2rad(15.0))),
        ("reach-aware", REACH_AWARE),
    ):
        found = steering.result_table(steering.steered(table, SteeringSettings(mapping=mapping)))
        found = found[(found["mode"] != "fist") & (found["reason"] == "")]
        tilt = np.hypot(found["goal_alpha_deg"], found["goal_gamma_deg"]).mean()
        errors = [_summary(found[column]) for column in ("position_error_mm", "direction_error_deg")]
        rows.append((name, *errors[0], *errors[1], tilt))
    columns = [f"{kind}_{what}_{unit}" for kind, unit in (("position", "mm"), ("direction", "deg"))
               for what in ("mean", "p95", "max")]  # fmt: skip
    return pd.DataFrame(rows, columns=["limit", *columns, "asked_deg"])


def _summary(values: pd.Series) -> tuple[float, float, float]:
    return float(values.mean()), float(values.quantile(0.95)), float(values.max())


def _interpolated(grid: pd.DataFrame, z: Array, radius: Array) -> Array:
    """Interpolate the reach map at points [mm]; outside its range the nearest edge counts."""
    heights, radii = grid.index.to_numpy(float), grid.columns.to_numpy(float)
    interpolate = RegularGridInterpolator((heights, radii), grid.to_numpy())
    points = np.column_stack([np.clip(z, heights[0], heights[-1]), np.clip(radius, radii[0], radii[-1])])
    return np.asarray(interpolate(points))


def fist_direction(
    rng_seed: np.random.SeedSequence, weights: tuple[float, ...] = (0.0, 1.0, 5.0, 20.0)
) -> pd.DataFrame:
    """Give Eq. (27) a direction term of several weights [mm/rad], in the experiment of Fig. 8(a).

    Returns
    -------
    DataFrame
        ``weight``, and over the fist: mean ``direction_error_deg``, mean ``position_error_mm``,
        ``mid_drift_mm`` (largest); ``exit_step_deg``: largest turn per 30 ms after the fist.
    """
    rows = []
    for weight in weights:
        settings = SteeringSettings(weights=StepWeights(locked_direction=weight))
        table = steering.fig8(np.random.default_rng(rng_seed), "a", settings)
        fist = table[table["mode"] == "fist"]
        mid = fist[["mid_x_mm", "mid_y_mm", "mid_z_mm"]]
        drift = np.linalg.norm(mid - mid.iloc[0], axis=1).max()
        after = table[table["time_s"] > fist["time_s"].max() - 0.05]
        rows.append((weight, fist["direction_error_deg"].mean(), fist["position_error_mm"].mean(), drift,
                     steering.direction_steps(after).max()))  # fmt: skip
    columns = ["weight", "direction_error_deg", "position_error_mm", "mid_drift_mm", "exit_step_deg"]
    return pd.DataFrame(rows, columns=columns)


RATES = (115.0, 58.0, 33.0, 15.0, 11.0, 5.0)
"""Rates of the loop whose delay is measured [Hz]; the first is the sensor's own."""


def delay_against_rate(
    rng_seed: np.random.SeedSequence, rates: tuple[float, ...] = RATES, bus: ServoBus | None = None
) -> pd.DataFrame:
    """Measure the delay from the hand to the commanded tip for several loop rates.

    The hand follows the infinity path while its tilt sways; the delay is the shift that fits the commanded
    tip, held between updates, best to what the hand did.

    Returns
    -------
    DataFrame
        ``loop``, ``position_ms``, ``direction_ms``; the last row, "servo bus", waits for the bus in each
        loop.
    """
    bus = bus or ServoBus()

    def sway(time: Array) -> Array:
        tilt = 0.25 * np.sin(2 * np.pi * np.asarray(time) / 4.0)
        return np.column_stack([np.sin(tilt), np.zeros_like(tilt), np.cos(tilt)])

    table = commanding_hand(np.random.default_rng(rng_seed), 16.0, steering.infinity_path, sway, noise=QUIET)
    rows: list[tuple[str, float, float]] = []
    for name, interval, busy in (
        *((f"{rate:.0f} Hz", 1.0 / rate if rate < 100 else 0.0, 0.0) for rate in rates),
        ("servo bus", bus.period, bus.period),
    ):
        commands = steering.result_table(steering.steered(table, interval=interval), steering.LEAD)
        applied = commands["time_s"].to_numpy() + busy
        fine = np.arange(1.0, 15.0, 0.001)
        held = np.searchsorted(applied, fine, side="right") - 1
        tip = commands["tip_x_mm"].to_numpy()[held] * 1e-3
        alpha = np.deg2rad(commands["alpha_deg"].to_numpy()[held])
        intended = [steering.infinity_path(fine)[:, 0], 0.25 * np.sin(2 * np.pi * fine / 4.0)]
        rows.append((name, _delay(fine, tip, intended[0]), _delay(fine, alpha, intended[1])))
    return pd.DataFrame(rows, columns=["loop", "position_ms", "direction_ms"])


def _delay(time: Array, followed: Array, intended: Array) -> float:
    """Return the shift [ms] that fits ``followed`` best to ``intended``."""
    shifts = np.arange(0, 500)
    inside = slice(600, -600)
    misfit = [np.square(followed[inside] - np.roll(intended, shift)[inside]).sum() for shift in shifts]
    return float(shifts[int(np.argmin(misfit))]) * (time[1] - time[0]) * 1e3


def sensor_rate_error(rng_seed: np.random.SeedSequence) -> pd.DataFrame:
    """Compare tracking at the sensor's rate, at 30 ms and at 90 ms, on the infinity path."""
    rows = []
    for name, interval in (("sensor", 0.0), ("30 ms", 0.030), ("90 ms", 0.090)):
        table = steering.fig7a(np.random.default_rng(rng_seed), interval=interval)
        rows.append((name, table["position_error_mm"].mean(), table["position_error_mm"].max(),
                     table["direction_error_deg"].max()))  # fmt: skip
    return pd.DataFrame(rows, columns=["loop", "position_mean_mm", "position_max_mm", "direction_max_deg"])
