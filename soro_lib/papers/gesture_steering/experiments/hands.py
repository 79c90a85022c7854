"""Hands: the shipped recordings, their stream, and what the filters do to it (Lai et al., Fig. 5)."""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.signal import butter, filtfilt
from scipy.spatial.transform import Rotation

from soro_lib.controllers.gestures import GestureRule
from soro_lib.controllers.hand_mapping import PalmMapping
from soro_lib.estimators.palm_filter import PAPER_SETTINGS, DirectionFilter, PalmFilter, PalmFilterSettings
from soro_lib.papers.gesture_steering.world.hand import HandNoise, synthetic_recording, tracing, wandering
from soro_lib.project import data_directory
from soro_lib.replication.datacards import verified, write_card
from soro_lib.sensing.hand_tracking import FINGERS, HandSample, hand_samples, load_hand_recording

Array = NDArray[np.float64]

RECORDING_SEED = 20260
A4_WIDTH, A4_LENGTH = 0.210, 0.297
HOVER = 8.0
"""Time that a hand hovers [s]."""
FILTERS = {
    "fixed noise": PalmFilterSettings(),
    "adaptive noise": PalmFilterSettings(adaptive=True),
    "R = 0.7 for all": PAPER_SETTINGS,
}
"""The palm filters that are compared."""
ABOUT = {
    "steering_minute": "random steering through all four gestures, with tracking losses and palm flips",
    "a4_palm": "a palm that traces the edges of an A4 sheet held flat",
    "a4_finger": "a finger tip, in the palm columns, that traces the edges of an A4 sheet",
    "hover": "eight seconds of hovering palm, then eight of hovering V-sign",
}
COLUMNS = {
    "timestamp_us": "[us] device clock",
    "frame_id": "[-] frame number",
    "hand_id": "[-] identity given by the tracker; empty when no hand is seen",
    "hand_type": "[-] left or right",
    "confidence": "[-] confidence of the tracker, 0 to 1",
    **{
        f"palm_{axis}_mm": f"[mm] palm centre, device {axis} (x right, y up, z toward the user)"
        for axis in "xyz"
    },
    **{f"palm_n{axis}": f"[-] palm normal, a unit vector, device {axis}" for axis in "xyz"},
    **{f"dir_{axis}": f"[-] direction of the hand, a unit vector, device {axis}" for axis in "xyz"},
    **{finger: "[-] 1 = extended, 0 = curled" for finger in FINGERS},
    **{f"palm_v{axis}_mm_s": f"[mm/s] palm velocity as reported, device {axis}" for axis in "xyz"},
}
"""Columns of the shipped recordings."""
FINGERTIP = HandNoise(tremor=(0.1e-3, 0.12e-3, 0.1e-3), drift=0.7e-3)
"""A finger guided by an edge is steadier than a palm in the air."""


def recording_path(name: str) -> Path:
    """Return where a recording lies: a shipped one by its name, any other by its path.

    Parameters
    ----------
    name : str
        ``steering_minute``, ``a4_palm``, ``a4_finger``, ``hover``, or the path of a file.
    """
    shipped = data_directory("gesture_steering") / "recordings" / f"{name}.csv.gz"
    return shipped if name in ABOUT else Path(name)


def shipped_recordings(seed: int = RECORDING_SEED) -> dict[str, pd.DataFrame]:
    """Simulate the recordings under ``data/gesture_steering/recordings``, by name.

    Parameters
    ----------
    seed : int
        Of the whole set; every recording has a stream of its own.
    """
    streams = [np.random.default_rng(child) for child in np.random.SeedSequence(seed).spawn(4)]
    return {
        "steering_minute": steering_recording(streams[0], 60.0, HandNoise(losses=0.1, flips=0.05)),
        "a4_palm": tracing_recording(streams[1], HandNoise()),
        "a4_finger": tracing_recording(streams[2], FINGERTIP),
        "hover": hover_recording(streams[3]),
    }


def write_recordings(directory: Path, seed: int = RECORDING_SEED) -> None:
    """Write the shipped recordings and their data cards; the same seed gives the same bytes."""
    directory.mkdir(parents=True, exist_ok=True)
    for name, table in shipped_recordings(seed).items():
        path = directory / f"{name}.csv.gz"
        text = table.to_csv(index=False, lineterminator="\n").encode()
        path.write_bytes(gzip.compress(text, mtime=0))
        generator = "soro_lib.papers.gesture_steering.experiments.hands.shipped_recordings"
        description = f"Simulated hand, no person was recorded: {ABOUT[name]}"
        write_card(path, description=description, columns=COLUMNS, generator=generator, seed=seed)


def steering_recording(
    rng: np.random.Generator, duration: float, noise: HandNoise | None = None
) -> pd.DataFrame:
    """Simulate a person who steers at random through all gestures, inside the allowed box.

    Parameters
    ----------
    rng : Generator
        Source of every draw.
    duration : float
        [s].
    noise : HandNoise, optional
        Restlessness and faults.
    """
    position = wandering(rng, duration, (-0.11, 0.13, -0.11), (0.11, 0.30, 0.11))
    pitch = wandering(rng, duration, (-0.4, -0.4), (0.4, 0.4))
    gestures: list[tuple[float, str]] = [(0.0, "palm")]
    coming: list[str] = []
    while gestures[-1][0] < duration - 8.0:
        if not coming:
            coming = rng.permutation(["v_sign", "thumbs_up", "fist"]).tolist()
        name = coming.pop() if gestures[-1][1] == "palm" else "palm"
        gestures.append((gestures[-1][0] + rng.uniform(3.0, 7.0), name))
    return synthetic_recording(rng, duration, position, _tilting(pitch), gestures, noise)


def tracing_recording(rng: np.random.Generator, noise: HandNoise) -> pd.DataFrame:
    """Simulate a hand tracing the edges of an A4 sheet 200 mm above the device; Lai et al., Fig. 5."""
    x, z = A4_LENGTH / 2, A4_WIDTH / 2
    corners = np.array([[-x, 0.2, -z], [x, 0.2, -z], [x, 0.2, z], [-x, 0.2, z], [-x, 0.2, -z]])
    path, duration = tracing(corners, 0.2)
    return synthetic_recording(rng, duration, path, lambda time: np.zeros((len(time), 3)), noise=noise)


def hover_recording(rng: np.random.Generator, duration: float = 2 * HOVER) -> pd.DataFrame:
    """Simulate a hovering palm for half the time, then a hovering V-sign; Lai et al., Fig. 10."""

    def position(time: Array) -> Array:
        return np.tile([0.05, 0.15, 0.04], (len(time), 1))

    def tilt(time: Array) -> Array:
        return np.tile([0.15, 0.0, 0.1], (len(time), 1))

    return synthetic_recording(rng, duration, position, tilt, [(0.0, "palm"), (duration / 2, "v_sign")])


def timeline(table: pd.DataFrame, mapping: PalmMapping | None = None) -> pd.DataFrame:
    """Follow a recording through filter, gesture rule and mapping, without a robot.

    Parameters
    ----------
    table : DataFrame
        A recording.
    mapping : PalmMapping, optional
        Hand to tip.

    Returns
    -------
    DataFrame
        One row per frame with a hand: ``time_s``; ``raw_{x,y,z}_mm`` and ``filtered_{x,y,z}_mm`` of the palm
        (device frame); ``goal_{x,y,z}_mm`` and ``goal_d{x,y,z}`` of the tip; ``tilt_raw_deg``, ``tilt_deg``
        of the pointing direction before and after its filter; ``fingers`` as "11111"; ``mode``.
    """
    mapping = mapping or PalmMapping()
    palm_filter, direction_filter, rule = PalmFilter(), DirectionFilter(), GestureRule()
    rows = []
    start, last = table["timestamp_us"].iloc[0] * 1e-6, None
    for sample in hand_samples(table):
        if sample.hand_id is None:
            continue
        velocity = sample.velocity if np.isfinite(sample.velocity[0]) else None
        filtered = palm_filter.update(sample.time, sample.palm, velocity)
        mode = rule.update(sample.time, sample.fingers)
        goal = mapping.goal(tuple(filtered), sample.normal, mode)
        direction = goal.direction
        smooth = direction_filter.update(sample.time - last if last is not None else 1.0, direction)
        last = sample.time
        rows.append(
            (sample.time - start,
             *np.multiply(sample.palm, 1e3), *filtered * 1e3, *np.multiply(goal.position, 1e3), *smooth,
             np.degrees(np.arccos(direction[2])), np.degrees(np.arccos(min(smooth[2], 1.0))),
             "".join("1" if flag else "0" for flag in sample.fingers), mode.value)
        )  # fmt: skip
    axes = [f"{kind}_{axis}_mm" for kind in ("raw", "filtered", "goal") for axis in "xyz"]
    columns = [
        "time_s",
        *axes,
        "goal_dx",
        "goal_dy",
        "goal_dz",
        "tilt_raw_deg",
        "tilt_deg",
        "fingers",
        "mode",
    ]
    return pd.DataFrame(rows, columns=columns)


def filtered_palm(
    table: pd.DataFrame, settings: PalmFilterSettings, use_velocity: bool = True
) -> tuple[Array, Array, Array]:
    """Return time (n,) [s], raw and filtered palm positions (n, 3) [m] of the frames with a hand."""
    samples = [sample for sample in hand_samples(table) if sample.hand_id is not None]
    palm_filter = PalmFilter(settings)
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
        for name, settings in FILTERS.items():
            time, raw, filtered = filtered_palm(table, settings)
            rows.append((recording, name, *_against_smoother(time, raw, filtered)))
        time, raw, filtered = filtered_palm(table, FILTERS["fixed noise"], use_velocity=False)
        rows.append((recording, "position only", *_against_smoother(time, raw, filtered)))
        rows.append((recording, "no filter", *_against_smoother(time, raw, raw)))
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
    x, z = np.abs(filtered[:, 0]) - A4_LENGTH / 2, np.abs(filtered[:, 2]) - A4_WIDTH / 2
    outside = np.hypot(np.maximum(x, 0), np.maximum(z, 0))
    deviation = np.where((x > 0) | (z > 0), outside, -np.maximum(x, z))
    normal = np.array([s.normal for s in hand_samples(table) if s.hand_id is not None])
    return pd.DataFrame(
        {
            "time_s": time,
            "x_mm": filtered[:, 0] * 1e3,
            "z_mm": filtered[:, 2] * 1e3,
            "deviation_mm": deviation * 1e3,
            "tilt_deg": np.degrees(np.arccos(np.clip(-normal[:, 1], -1, 1))),
        }
    )


def _against_smoother(
    time: Array, raw: Array, filtered: Array, cutoff: float = 6.0
) -> tuple[float, float, float]:
    """Return mean error [mm], lag [ms] and relative roughness of a filtered path."""
    rate = 115.0
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


def _tilting(pitch_and_roll):  # type: ignore[no-untyped-def]
    """Turn a path of (pitch, roll) [rad] into rotation vectors about the device's x and z axes."""

    def tilt(time: Array) -> Array:
        pitch, roll = pitch_and_roll(time).T
        turns = Rotation.from_rotvec(np.outer(pitch, [1, 0, 0])) * Rotation.from_rotvec(
            np.outer(roll, [0, 0, 1])
        )
        return turns.as_rotvec()

    return tilt


def load_recording(name: str) -> pd.DataFrame:
    """Load a recording by the name of a shipped one or by its path."""
    path = recording_path(name)
    shipped = path.parent == data_directory("gesture_steering") / "recordings"
    return load_hand_recording(verified(path) if shipped else path)
