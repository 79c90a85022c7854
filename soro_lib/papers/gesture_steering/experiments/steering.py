"""Steering in simulation: poses, paths, gesture changes and loop rate (Lai et al., Figs. 6 to 9)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from soro_lib.controllers.gesture_steering import GestureSteering, SteeringResult, SteeringSettings, replay
from soro_lib.controllers.hand_mapping import PalmMapping
from soro_lib.papers.gesture_steering.experiments.hands import steering_recording
from soro_lib.papers.gesture_steering.world.hand import FINGER_FLAGS, HandNoise, synthetic_recording
from soro_lib.robots import CableDrivenArm
from soro_lib.sensing.hand_tracking import HandSample, hand_samples

Array = NDArray[np.float64]
Path = Callable[[Array], Array]

LEAD = 2.0
"""Time that a simulated operator waits at the start of a path, and that is not evaluated [s]."""
CONTROL_PERIOD = 0.030
"""The paper's sampling time [s]."""
HIGH_REACH = PalmMapping(offset=0.165)
"""The device 75 mm lower, all scales as printed. With the printed offset the 140 mm of Fig. 7(b) need a palm
50 mm above
the device, which is outside the allowed box (erratum GS-6)."""


@dataclass(frozen=True)
class ServoBus:
    """Seven servos on one serial bus behind a USB adapter.

    Parameters
    ----------
    servos : int
        Write transactions per loop, one after another [-].
    latency : float
        Time until the adapter hands a status packet on: the default latency timer of its chip [s].
    computation : float
        Time of one control step [s]; an upper bound of what the benchmarks measure.
    """

    servos: int = 7
    latency: float = 0.016
    computation: float = 0.0001

    @property
    def period(self) -> float:
        """Duration of one loop [s]."""
        return self.servos * self.latency + self.computation


# --- operators ---------------------------------------------------------------------------------------------


def commanding_hand(
    rng: np.random.Generator,
    duration: float,
    position: Path,
    direction: Path,
    gestures: Sequence[tuple[float, str]] = ((0.0, "palm"),),
    mapping: PalmMapping | None = None,
    noise: HandNoise | None = None,
) -> pd.DataFrame:
    """Simulate the hand of an operator who wants the tip to follow a path.

    Parameters
    ----------
    rng : Generator
        Source of tremor and clock.
    duration : float
        [s], after a lead of ``LEAD`` at the start of the path.
    position, direction : callable
        Map times (n,) [s] to wanted tip positions (n, 3) [m] and unit pointing directions (n, 3).
    gestures : sequence of (float, str)
        Start [s] and name, counted from the start of the path; the first at 0.
    mapping : PalmMapping, optional
        What the operator has learned to invert.
    noise : HandNoise, optional
        Restlessness of the hand.
    """
    mapping = mapping or PalmMapping()

    def palm(time: Array) -> Array:
        return np.array([mapping.palm(tuple(point)) for point in position(np.maximum(time - LEAD, 0.0))])

    def tilt(time: Array) -> Array:
        wanted = direction(np.maximum(time - LEAD, 0.0))
        normals = np.array([mapping.normal(tuple(row)) for row in wanted])
        return _turns((0.0, -1.0, 0.0), normals)

    script = [(start + LEAD if start > 0 else 0.0, name) for start, name in gestures]
    return synthetic_recording(rng, duration + LEAD, palm, tilt, script, noise)


def at_interval(samples: Iterable[HandSample], interval: float) -> list[HandSample]:
    """Return the frames that a controller sees that takes one per period [s]."""
    taken: list[HandSample] = []
    for sample in samples:
        if not taken or sample.time - taken[-1].time >= interval - 1e-4:
            taken.append(sample)
    return taken


def steered(
    table: pd.DataFrame,
    settings: SteeringSettings | None = None,
    arm: CableDrivenArm | None = None,
    interval: float = 0.0,
) -> list[SteeringResult]:
    """Replay a recording through the controller, at the sensor's rate or at the given interval [s]."""
    samples = at_interval(hand_samples(table), interval) if interval else list(hand_samples(table))
    return replay(GestureSteering(arm or CableDrivenArm(), settings), samples)


def result_table(results: Sequence[SteeringResult], lead: float = 0.0) -> pd.DataFrame:
    """Turn results into a tidy table.

    Parameters
    ----------
    results : sequence of SteeringResult
        In time order.
    lead : float
        Time before zero [s].

    Returns
    -------
    DataFrame
        ``time_s``; ``tip_*_mm``, ``target_*_mm``, ``goal_*_mm``; ``alpha_deg``,
        ``gamma_deg``: tilt of the tip towards +x and +y, and of the target (``target_alpha_deg``, ...);
        ``position_error_mm``, ``direction_error_deg``; ``mode``, ``reason``; ``slide_mm`` and ``cable_1`` to
        ``cable_6`` (-N).
    """
    time = np.array([result.time for result in results])
    columns: dict[str, ArrayLike] = {"time_s": time - time[0] - lead}
    for name, rows in (
        ("tip", [result.tip for result in results]),
        ("mid", [result.mid for result in results]),
        ("target", [result.target_position for result in results]),
        ("goal", [result.goal.position for result in results]),
    ):
        columns |= {f"{name}_{axis}_mm": values for axis, values in zip("xyz", np.array(rows).T * 1e3)}
    for name, rows in (
        ("", [result.direction for result in results]),
        ("target_", [result.target_direction for result in results]),
        ("goal_", [result.goal.direction for result in results]),
    ):
        x, y, z = np.array(rows).T
        columns |= {
            f"{name}alpha_deg": np.degrees(np.arctan2(x, z)),
            f"{name}gamma_deg": np.degrees(np.arctan2(y, z)),
        }
    columns["position_error_mm"] = [1e3 * result.position_error for result in results]
    columns["direction_error_deg"] = [np.degrees(result.direction_error) for result in results]
    columns["mode"] = [result.mode.value for result in results]
    columns["reason"] = [result.reason for result in results]
    actuation = np.array([result.actuation for result in results])
    columns["slide_mm"] = actuation[:, 0] * 1e3
    columns |= {f"cable_{index}": values for index, values in enumerate(actuation[:, 1:].T, start=1)}
    return pd.DataFrame(columns)


# --- Fig. 6 ------------------------------------------------------------------------------------------------

FIG6_HANDS: tuple[tuple[str, str, tuple[float, float, float], tuple[float, float, float]], ...] = (
    ("palm, lower front", "palm", (0.0, 0.20, 0.05), (0.45, 0.0, 0.0)),
    ("palm, right", "palm", (0.08, 0.20, 0.0), (0.0, 0.0, 0.45)),
    ("V-sign, left", "v_sign", (0.05, 0.18, 0.03), (0.0, 0.0, -0.5)),
    ("thumbs-up", "thumbs_up", (0.05, 0.18, 0.03), (0.0, 0.0, 0.4)),
    ("fist, first position", "fist", (-0.03, 0.21, -0.03), (0.0, 0.0, 0.0)),
    ("fist, second position", "fist", (0.05, 0.21, 0.04), (0.0, 0.0, 0.0)),
)
"""Name, gesture, palm [m] and tilt [rad, rotation vector] of the six poses, device frame."""


def fig6_poses() -> list[tuple[str, SteeringResult]]:
    """Hold the six hands of Fig. 6 for three seconds each, in one session, and return the final poses."""
    steering = GestureSteering(CableDrivenArm())
    poses = []
    for index, (name, gesture, palm, tilt) in enumerate(FIG6_HANDS):
        x, y, z = Rotation.from_rotvec(tilt).apply([0.0, -1.0, 0.0]).tolist()
        fingers = tuple(flag == 1 for flag in FINGER_FLAGS[gesture])
        times = 3.0 * index + np.arange(1, 301) * 0.01
        for time in times.tolist():
            result = steering.update(HandSample(time, 1, palm, (x, y, z), fingers))  # type: ignore[arg-type]
        poses.append((name, result))
    return poses


# --- Fig. 7 ------------------------------------------------------------------------------------------------


def infinity_path(time: Array, amplitude: float = 0.025, height: float = 0.120, period: float = 8.0) -> Array:
    """Return the figure-eight of Fig. 7(a): positions (n, 3) [m]; amplitude and period are ours."""
    phase = 2 * np.pi * np.asarray(time) / period
    return np.column_stack(
        [amplitude * np.sin(phase), amplitude * np.sin(phase) * np.cos(phase), np.full_like(phase, height)]
    )


def cone(time: Array, opening: float, period: float = 8.0) -> Array:
    """Return directions (n, 3) that go round e_z at ``opening`` [rad], opened over the first second."""
    time = np.asarray(time, dtype=float)
    phase = 2 * np.pi * time / period
    tilt = opening * np.clip(time, 0.0, 1.0)
    return np.column_stack([np.sin(tilt) * np.cos(phase), np.sin(tilt) * np.sin(phase), np.cos(tilt)])


def straight(time: Array) -> Array:
    """Return e_z for every time: a palm held flat."""
    return np.tile([0.0, 0.0, 1.0], (len(time), 1))


def fig7a(
    rng: np.random.Generator,
    settings: SteeringSettings | None = None,
    interval: float = CONTROL_PERIOD,
    noise: HandNoise | None = None,
    duration: float = 16.0,
) -> pd.DataFrame:
    """Steer the tip along the infinity path with a flat palm; evaluated from time 0 on."""
    table = commanding_hand(rng, duration, infinity_path, straight, noise=noise)
    return result_table(steered(table, settings, interval=interval), LEAD).query("time_s >= 0")


def fig7b(
    rng: np.random.Generator,
    settings: SteeringSettings | None = None,
    interval: float = CONTROL_PERIOD,
    noise: HandNoise | None = None,
    opening: float = np.deg2rad(15.0),
    duration: float = 16.0,
) -> pd.DataFrame:
    """Turn the tip about the fixed point (-15, -20, 140) mm."""
    settings = replace(settings or SteeringSettings(), mapping=HIGH_REACH)
    table = commanding_hand(
        rng, duration,
        lambda time: np.tile([-0.015, -0.020, 0.140], (len(time), 1)),
        lambda time: cone(time, opening),
        mapping=HIGH_REACH, noise=noise,
    )  # fmt: skip
    return result_table(steered(table, settings, interval=interval), LEAD).query("time_s >= 0")


# --- Fig. 8 ------------------------------------------------------------------------------------------------

FIG8_SCRIPTS = {
    "a": ((0.0, "palm"), (4.0, "fist"), (8.0, "palm")),
    "b": ((0.0, "palm"), (4.0, "thumbs_up"), (8.0, "palm")),
    "c": ((0.0, "palm"), (4.0, "v_sign"), (8.0, "palm")),
    "d": ((0.0, "palm"),),
}
"""Gestures of the four panels of Fig. 8: start [s], name."""


def fig8(rng: np.random.Generator, panel: str, settings: SteeringSettings | None = None,
         interval: float = CONTROL_PERIOD, noise: HandNoise | None = None) -> pd.DataFrame:  # fmt: skip
    """Change gestures with a hand that never stops turning (tilt 7 to 23 degrees)."""

    def direction(time: Array) -> Array:
        tilt, azimuth = np.deg2rad(15.0 + 8.0 * np.sin(2 * np.pi * time / 5.0)), 2 * np.pi * time / 6.0
        return np.column_stack([np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), np.cos(tilt)])

    def position(time: Array) -> Array:
        return np.tile([0.010, -0.008, 0.115], (len(time), 1))

    table = commanding_hand(rng, 12.0, position, direction, FIG8_SCRIPTS[panel], noise=noise)
    return result_table(steered(table, settings, interval=interval), LEAD).query("time_s >= 0")


def direction_steps(table: pd.DataFrame, per: float = CONTROL_PERIOD) -> Array:
    """Return the turn of the tip between frames, scaled to ``per`` [s]: (n - 1,) [deg]."""
    alpha, gamma = np.tan(np.deg2rad(table["alpha_deg"])), np.tan(np.deg2rad(table["gamma_deg"]))
    direction = np.column_stack([alpha, gamma, np.ones(len(table))])
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    cosine = np.sum(direction[1:] * direction[:-1], axis=1)
    return np.degrees(np.arccos(np.clip(cosine, -1, 1))) * per / np.diff(table["time_s"])


# --- Fig. 9 ------------------------------------------------------------------------------------------------


def fig9(rng: np.random.Generator, duration: float = 130.0, bus: ServoBus | None = None) -> pd.DataFrame:
    """Steer at random and note the rate of the loop, without and with the servo bus.

    The rate is simulated, not timed: a loop takes the newest frame, computes, and, with servos, waits for the
    bus.

    Returns
    -------
    DataFrame
        ``loop`` ("no servos", "servo bus"), ``time_s``, ``rate_hz``.
    """
    bus = bus or ServoBus()
    stamps = steering_recording(rng, duration)["timestamp_us"].to_numpy() * 1e-6
    stamps = stamps - stamps[0]
    tables = []
    for name, busy in (("no servos", bus.computation), ("servo bus", bus.period)):
        starts = loop_starts(stamps, busy)
        tables.append(pd.DataFrame({"loop": name, "time_s": starts[1:], "rate_hz": 1.0 / np.diff(starts)}))
    return pd.concat(tables, ignore_index=True)


def loop_starts(stamps: Array, busy: float) -> Array:
    """Return when a loop starts that waits for a frame it has not seen, then is busy for some time [s].

    Parameters
    ----------
    stamps : ndarray (n,)
        Arrival of the frames [s].
    busy : float
        Time that one pass takes [s].
    """
    starts: list[float] = []
    free, seen = 0.0, -1
    while True:
        newest = int(np.searchsorted(stamps, free, side="right")) - 1
        frame = max(newest, seen + 1)
        if frame >= len(stamps):
            return np.array(starts)
        start = max(free, float(stamps[frame]))
        starts.append(start)
        seen, free = frame, start + busy


# --- helpers -----------------------------------------------------------------------------------------------


def _turns(rest: tuple[float, float, float], vectors: Array) -> Array:
    """Return the rotation vectors (n, 3) that turn the unit vector ``rest`` into each of ``vectors``."""
    axis = np.cross(rest, vectors)
    sine = np.linalg.norm(axis, axis=1, keepdims=True)
    angle = np.arctan2(sine, vectors @ np.array(rest)[:, None])
    return np.where(sine > 1e-12, axis / np.maximum(sine, 1e-12) * angle, 0.0)
