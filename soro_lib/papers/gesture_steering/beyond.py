"""Beyond the paper: reach, a fist that keeps its direction, delay against rate, error ellipses."""

import numpy as np
import pandas as pd
from scipy.interpolate import RegularGridInterpolator

from soro_lib.controllers.gesture_steering import SteeringSettings
from soro_lib.controllers.hand_mapping import PalmMapping
from soro_lib.controllers.steering_step import StepBounds, StepWeights, pose_step, solve
from soro_lib.papers.gesture_steering.experiments import steering
from soro_lib.papers.gesture_steering.experiments.steering import ServoBus, commanding_hand, pointing
from soro_lib.papers.gesture_steering.world.hand import QUIET, Array
from soro_lib.robots import CableDrivenArm
from soro_lib.robots.cable_driven_kernels import compiled_kinematics


def reached(arm: CableDrivenArm, positions: Array, directions: Array) -> tuple[Array, Array]:
    """Return how close the arm comes to poses: distances (n,) [m] and angles (n,) [rad], by repeated Eq.
    (26).

    Local solves from two starts: "not reached" means "not found".

    Parameters
    ----------
    arm : CableDrivenArm
        The arm.
    positions, directions : ndarray (n, 3)
        Wanted tips [m] and unit pointing directions.
    """
    kinematics = compiled_kinematics(arm)
    weights, largest = StepWeights(damping=0.1), np.array([0.02, *[0.5] * 6])
    found = np.full((len(positions), 2), np.inf)
    for index, (position, direction) in enumerate(zip(positions, directions)):
        for tension in (0.05, 0.8):
            actuation = np.array([np.clip(position[2] - 0.09, 0.0, arm.slide_length), *[-tension] * 6])
            for _ in range(40):
                pose = kinematics(actuation)
                wanted = np.clip(position - pose.tip, -0.02, 0.02)
                lower = np.maximum(arm.lower - actuation, -largest)
                upper = np.minimum(arm.upper - actuation, largest)
                bounds = StepBounds(lower, upper)
                step = solve(pose_step(pose, wanted, direction - pose.direction, bounds, weights))
                actuation = np.clip(actuation + step.actuation_step, arm.lower, arm.upper)
                if np.abs(step.actuation_step).max() < 1e-5:
                    break
            pose = kinematics(actuation)
            error = np.linalg.norm(pose.tip - position), np.linalg.norm(pose.direction - direction)
            found[index] = min(tuple(found[index]), error, key=lambda pair: pair[0] + 0.05 * pair[1])
    return found[:, 0], found[:, 1]


def reach_map(heights: Array, radii: Array, tilts: Array, azimuths: int = 6) -> pd.DataFrame:
    """Find the largest tilt that the tip can take towards every azimuth.

    Parameters
    ----------
    heights, radii : ndarray
        Tip heights and distances from the axis [m].
    tilts : ndarray
        Tilts that are tried, ascending [rad].
    azimuths : int
        Directions of tilt, relative to the tip's own azimuth [-].

    Returns
    -------
    DataFrame
        ``z_mm``, ``radius_mm``, ``tilt_deg``: largest tilt reached within 0.5 mm and 1 deg towards every
        azimuth; NaN where not even a straight tip is.
    """
    arm, rows = CableDrivenArm(), []
    for height in heights:
        for radius in radii:
            best = np.nan
            for tilt in tilts:
                around = 2 * np.pi * np.arange(azimuths if tilt > 0 else 1) / azimuths
                directions = pointing(np.full_like(around, tilt), around)
                positions = np.tile([radius, 0.0, height], (len(around), 1))
                distance, angle = reached(arm, positions, directions)
                if (distance > 0.5e-3).any() or (angle > np.deg2rad(1.0)).any():
                    break
                best = tilt
            rows.append((height * 1e3, radius * 1e3, np.degrees(best)))
    return pd.DataFrame(rows, columns=["z_mm", "radius_mm", "tilt_deg"])


def mapping_choice(reach: pd.DataFrame) -> pd.DataFrame:
    """Judge choices of c_z and offset by what share of the allowed box the arm can serve.

    Parameters
    ----------
    reach : DataFrame
        From :func:`reach_map`.

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
    for offset in (0.150, 0.165):
        for scale in (-0.05, -0.1, -0.15, -0.2):
            mapping = PalmMapping(scale_z=scale, offset=offset)
            palms = np.linspace(mapping.lowest, mapping.highest, 13)
            tips = np.array([mapping.position((a, b, c)) for b in palms for a, c in zip(x, z)]) * 1e3
            tilt = _interpolated(grid, tips[:, 2], np.hypot(tips[:, 0], tips[:, 1]))
            shares = np.mean(tilt >= 0), np.mean(tilt >= 20 - 1e-9)
            clamp = max(float(np.percentile(tilt, 10)), 0.0)
            rows.append((scale, offset * 1e3, tips[:, 2].min(), tips[:, 2].max(), *shares, clamp))
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
    limits = {
        "30 deg everywhere": PalmMapping(),
        "15 deg everywhere": PalmMapping(maximum_tilt=np.deg2rad(15.0)),
        "reach-aware": REACH_AWARE,
    }
    rows = []
    for name, mapping in limits.items():
        found = steering.result_table(steering.steered(table, SteeringSettings(mapping=mapping)))
        found = found[(found["mode"] != "fist") & (found["reason"] == "")]
        tilt = np.hypot(found["goal_alpha_deg"], found["goal_gamma_deg"]).mean()
        errors = found[["position_error_mm", "direction_error_deg"]]
        values = np.transpose([errors.mean(), errors.quantile(0.95), errors.max()])
        rows.append((name, *values.ravel(), tilt))
    statistics = ("mean", "p95", "max")
    columns = [kind % what for kind in ("position_%s_mm", "direction_%s_deg") for what in statistics]
    return pd.DataFrame(rows, columns=["limit", *columns, "asked_deg"])


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
        errors = fist["direction_error_deg"].mean(), fist["position_error_mm"].mean()
        rows.append((weight, *errors, drift, steering.direction_steps(after).max()))
    columns = ["weight", "direction_error_deg", "position_error_mm", "mid_drift_mm", "exit_step_deg"]
    return pd.DataFrame(rows, columns=columns)


RATES = (115.0, 58.0, 33.0, 15.0, 11.0, 5.0)
"""Rates of the loop whose delay is measured [Hz]; the first is the sensor's own."""


def delay_against_rate(rng_seed: np.random.SeedSequence, rates: tuple[float, ...] = RATES) -> pd.DataFrame:
    """Measure the delay from the hand to the commanded tip for several loop rates.

    The hand follows the infinity path while its tilt sways; the delay is the shift that fits the commanded
    tip, held between updates, best to what the hand did.

    Returns
    -------
    DataFrame
        ``loop``, ``position_ms``, ``direction_ms``; the last row, "servo bus", waits for the bus in each
        loop.
    """

    def tilt(time: Array) -> Array:
        return 0.25 * np.sin(2 * np.pi * np.asarray(time) / 4.0)

    def sway(time: Array) -> Array:
        return np.column_stack([np.sin(tilt(time)), np.zeros_like(time), np.cos(tilt(time))])

    table = commanding_hand(np.random.default_rng(rng_seed), 16.0, steering.infinity_path, sway, noise=QUIET)
    busy_period = ServoBus().period
    loops = [(f"{rate:.0f} Hz", 1.0 / rate if rate < 100 else 0.0, 0.0) for rate in rates]
    rows = []
    for name, interval, busy in (*loops, ("servo bus", busy_period, busy_period)):
        commands = steering.result_table(steering.steered(table, interval=interval), steering.LEAD)
        applied = commands["time_s"].to_numpy() + busy
        fine = np.arange(1.0, 15.0, 0.001)
        held = np.searchsorted(applied, fine, side="right") - 1
        tip = commands["tip_x_mm"].to_numpy()[held] * 1e-3
        alpha = np.deg2rad(commands["alpha_deg"].to_numpy()[held])
        position = _delay(fine, tip, steering.infinity_path(fine)[:, 0])
        rows.append((name, position, _delay(fine, alpha, tilt(fine))))
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
        error = table["position_error_mm"]
        rows.append((name, error.mean(), error.max(), table["direction_error_deg"].max()))
    return pd.DataFrame(rows, columns=["loop", "position_mean_mm", "position_max_mm", "direction_max_deg"])
