"""Hands: what the filters, the gesture rule and the mapping do to a recording (Lai et al., Fig. 5)."""

import numpy as np
import pandas as pd
from scipy.signal import butter, filtfilt

from soro_lib.controllers.gestures import GestureRule
from soro_lib.controllers.hand_mapping import PalmMapping
from soro_lib.estimators.palm_filter import PAPER_SETTINGS, DirectionFilter, PalmFilter, PalmFilterSettings
from soro_lib.papers.gesture_steering.world.hand import Array
from soro_lib.paths import A4_PAPER
from soro_lib.sensing.hand_tracking import HandSample, hand_samples

FILTERS = {
    "fixed noise": PalmFilterSettings(),
    "adaptive noise": PalmFilterSettings(adaptive=True),
    "R = 0.7 for all": PAPER_SETTINGS,
}
"""The palm filters that are compared."""


def timeline(table: pd.DataFrame) -> pd.DataFrame:
    """Follow a recording through filter, gesture rule and mapping, without a robot.

    Parameters
    ----------
    table : DataFrame
        A recording.

    Returns
    -------
    DataFrame
        One row per frame with a hand: ``time_s``; ``raw_{x,y,z}_mm`` and ``filtered_{x,y,z}_mm`` of the palm
        (device frame); ``goal_{x,y,z}_mm`` of the tip; ``tilt_raw_deg``, ``tilt_deg`` of the pointing
        direction before and after its filter; ``fingers`` as "11111"; ``mode``.
    """
    mapping, rule = PalmMapping(), GestureRule()
    palm_filter, direction_filter = PalmFilter(), DirectionFilter()
    rows = []
    start, last = table["timestamp_us"].iloc[0] * 1e-6, None
    for sample in _seen(table):
        filtered = palm_filter.update(sample.time, sample.palm, _velocity(sample))
        mode = rule.update(sample.time, sample.fingers)
        goal = mapping.goal(tuple(filtered), sample.normal, mode)
        smooth = direction_filter.update(1.0 if last is None else sample.time - last, goal.direction)
        last = sample.time
        positions = 1e3 * np.concatenate([sample.palm, filtered, goal.position])
        tilts = np.degrees(np.arccos([goal.direction[2], min(smooth[2], 1.0)]))
        fingers = "".join("1" if flag else "0" for flag in sample.fingers)
        rows.append((sample.time - start, *positions, *tilts, fingers, mode.value))
    axes = [f"{kind}_{axis}_mm" for kind in ("raw", "filtered", "goal") for axis in "xyz"]
    return pd.DataFrame(rows, columns=["time_s", *axes, "tilt_raw_deg", "tilt_deg", "fingers", "mode"])


def filtered_palm(
    table: pd.DataFrame, settings: PalmFilterSettings, use_velocity: bool = True
) -> tuple[Array, Array, Array]:
    """Return time (n,) [s], raw and filtered palm positions (n, 3) [m] of the frames with a hand."""
    samples, palm_filter = _seen(table), PalmFilter(settings)
    filtered = [palm_filter.update(s.time, s.palm, _velocity(s) if use_velocity else None) for s in samples]
    time = np.array([sample.time for sample in samples])
    return time - time[0], np.array([sample.palm for sample in samples]), np.array(filtered)


def filter_comparison(tables: dict[str, pd.DataFrame]) -> pd.DataFrame:
    """Compare the palm filters against a zero-phase smoother that sees the future.

    Parameters
    ----------
    tables : dict of str to DataFrame
        Recordings by name.

    Returns
    -------
    DataFrame
        ``recording``, ``filter``, ``error_mm`` (mean distance to the smoother), ``lag_ms`` (delay that fits
        it best), ``roughness`` (second difference relative to the raw palm's).
    """
    rows = []
    for recording, table in tables.items():
        paths = {name: filtered_palm(table, settings) for name, settings in FILTERS.items()}
        paths["position only"] = filtered_palm(table, PalmFilterSettings(), use_velocity=False)
        time, raw, _ = paths["fixed noise"]
        paths["no filter"] = time, raw, raw
        rows += [(recording, name, *_against_smoother(*path)) for name, path in paths.items()]
    return pd.DataFrame(rows, columns=["recording", "filter", "error_mm", "lag_ms", "roughness"])


def sheet_deviation(table: pd.DataFrame) -> pd.DataFrame:
    """Measure how far a traced path is from the edges of the A4 sheet.

    Returns
    -------
    DataFrame
        ``time_s``, ``x_mm``, ``z_mm`` (filtered, device frame), ``deviation_mm`` (distance to the nearest
        edge, in the plane of the sheet), ``tilt_deg`` of the palm normal from straight down.
    """
    time, _, filtered = filtered_palm(table, FILTERS["fixed noise"])
    x, z = (np.abs(filtered[:, [0, 2]]) - np.array(A4_PAPER) / 2).T
    outside = np.hypot(np.maximum(x, 0), np.maximum(z, 0))
    deviation = np.where((x > 0) | (z > 0), outside, -np.maximum(x, z))
    down = np.array([-sample.normal[1] for sample in _seen(table)])
    tilt = np.degrees(np.arccos(np.clip(down, -1, 1)))
    millimetres = 1e3 * np.column_stack([filtered[:, [0, 2]], deviation])
    columns = dict(zip(("x_mm", "z_mm", "deviation_mm"), millimetres.T))
    return pd.DataFrame({"time_s": time, **columns, "tilt_deg": tilt})


def _seen(table: pd.DataFrame) -> list[HandSample]:
    """Return the frames with a hand."""
    return [sample for sample in hand_samples(table) if sample.hand_id is not None]


def _against_smoother(time: Array, raw: Array, filtered: Array) -> tuple[float, float, float]:
    """Return mean error [mm], lag [ms] and relative roughness of a filtered path."""
    rate, cutoff = 115.0, 6.0
    grid = np.arange(time[0], time[-1], 1 / rate)
    numerator, denominator = butter(2, cutoff / (rate / 2))
    uniform = np.column_stack([np.interp(grid, time, column) for column in raw.T])
    smooth = filtfilt(numerator, denominator, uniform, axis=0)
    ours = np.column_stack([np.interp(grid, time, column) for column in filtered.T])
    middle = slice(30, len(grid) - 30)
    error = np.linalg.norm(ours - smooth, axis=1)[middle].mean()
    lags = np.arange(-10, 61) * 1e-3
    misfit = [np.square(ours - _delayed(grid, smooth, lag))[middle].sum() for lag in lags]
    rough = np.abs(np.diff(ours, 2, axis=0)).mean() / np.abs(np.diff(uniform, 2, axis=0)).mean()
    return error * 1e3, float(lags[int(np.argmin(misfit))]) * 1e3, float(rough)


def _delayed(grid: Array, path: Array, lag: float) -> Array:
    return np.column_stack([np.interp(grid - lag, grid, column) for column in path.T])


def _velocity(sample: HandSample) -> tuple[float, float, float] | None:
    return sample.velocity if np.isfinite(sample.velocity[0]) else None
