"""Steering in simulation: poses, paths, gesture changes and loop rate (Lai et al., Figs. 6 to 9)."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from operator import attrgetter

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from soro_lib.controllers.gesture_steering import GestureSteering, SteeringResult, SteeringSettings, replay
from soro_lib.controllers.hand_mapping import PalmMapping
from soro_lib.papers.gesture_steering.recordings import steering_recording
from soro_lib.papers.gesture_steering.world import hand
from soro_lib.papers.gesture_steering.world.hand import FINGER_FLAGS, Array, HandNoise, Path, constant
from soro_lib.robots import CableDrivenArm
from soro_lib.sensing.hand_tracking import HandSample, hand_samples

LEAD = 2.0
"""Time that a simulated operator waits at the start of a path, and that is not evaluated [s]."""
CONTROL_PERIOD = 0.030
"""The paper's sampling time [s]."""
HIGH_REACH = PalmMapping(offset=0.165)
"""The device 75 mm lower, all scales as printed. With the printed offset the 140 mm of Fig. 7(b) need a palm
50 mm above
the device, which is outside the allowed box (erratum GS-6)."""
ACTUATION = ["slide_mm", *(f"cable_{index}" for index in range(1, 7))]
ACTUATION_UNITS = np.array([1e3, *[1.0] * 6])
"""Columns of a table of results that hold the actuation, and what it is multiplied by to fill them."""


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
    return hand.synthetic_recording(rng, duration + LEAD, palm, tilt, script, noise)


def at_interval(samples: Iterable[HandSample], interval: float) -> list[HandSample]:
    """Return the frames that a controller sees that takes one per period [s]."""
    taken: list[HandSample] = []
    for sample in samples:
        if not taken or sample.time - taken[-1].time >= interval - 1e-4:
            taken.append(sample)
    return taken


def steered(
    table: pd.DataFrame, settings: SteeringSettings | None = None, interval: float = 0.0
) -> list[SteeringResult]:
    """Replay a recording through the controller, at the sensor's rate or at the given interval [s]."""
    samples = at_interval(hand_samples(table), interval) if interval else list(hand_samples(table))
    return replay(GestureSteering(CableDrivenArm(), settings), samples)


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

    def series(attribute: str) -> Array:
        return np.array([attrgetter(attribute)(result) for result in results])

    columns: dict[str, ArrayLike] = {"time_s": series("time") - results[0].time - lead}
    positions = {"tip": "tip", "mid": "mid", "target": "target_position", "goal": "goal.position"}
    for name, attribute in positions.items():
        columns |= {f"{name}_{axis}_mm": values for axis, values in zip("xyz", series(attribute).T * 1e3)}
    directions = {"": "direction", "target_": "target_direction", "goal_": "goal.direction"}
    for name, attribute in directions.items():
        x, y, z = series(attribute).T
        columns[f"{name}alpha_deg"] = np.degrees(np.arctan2(x, z))
        columns[f"{name}gamma_deg"] = np.degrees(np.arctan2(y, z))
    columns["position_error_mm"] = 1e3 * series("position_error")
    columns["direction_error_deg"] = np.degrees(series("direction_error"))
    columns["mode"] = [result.mode.value for result in results]
    columns["reason"] = [result.reason for result in results]
    columns |= zip(ACTUATION, (series("actuation") * ACTUATION_UNITS).T)
    return pd.DataFrame(columns)


def actuations(table: pd.DataFrame) -> Array:
    """Return the actuations (n, 7) of a table of results: slide [m] and cables."""
    return table[ACTUATION].to_numpy() / ACTUATION_UNITS


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
        times = 3.0 * index + np.arange(1, 301) * 0.01
        frames = [HandSample(time, 1, palm, (x, y, z), FINGER_FLAGS[gesture]) for time in times.tolist()]
        poses.append((name, replay(steering, frames)[-1]))
    return poses


# --- Fig. 7 ------------------------------------------------------------------------------------------------


def infinity_path(time: Array) -> Array:
    """Return the figure-eight of Fig. 7(a): positions (n, 3) [m]; amplitude and period are ours."""
    phase = 2 * np.pi * np.asarray(time) / 8.0
    x = 0.025 * np.sin(phase)
    return np.column_stack([x, x * np.cos(phase), np.full_like(phase, 0.120)])


def pointing(tilt: Array, azimuth: Array) -> Array:
    """Return unit directions (n, 3) that lean from e_z toward an azimuth [rad]."""
    return np.column_stack([np.sin(tilt) * np.cos(azimuth), np.sin(tilt) * np.sin(azimuth), np.cos(tilt)])


straight = constant(0.0, 0.0, 1.0)
"""The direction e_z at every time: a palm held flat."""


def steered_by_hand(
    rng: np.random.Generator,
    duration: float,
    position: Path,
    direction: Path,
    gestures: Sequence[tuple[float, str]] = ((0.0, "palm"),),
    settings: SteeringSettings | None = None,
    noise: HandNoise | None = None,
    interval: float = CONTROL_PERIOD,
) -> pd.DataFrame:
    """Steer with a commanding hand; results from time 0 on. Arguments as of `commanding_hand`, `steered`."""
    settings = settings or SteeringSettings()
    table = commanding_hand(rng, duration, position, direction, gestures, settings.mapping, noise)
    return result_table(steered(table, settings, interval=interval), LEAD).query("time_s >= 0")


def fig7a(rng: np.random.Generator, interval: float = CONTROL_PERIOD, duration: float = 16.0) -> pd.DataFrame:
    """Steer the tip along the infinity path with a flat palm; evaluated from time 0 on."""
    return steered_by_hand(rng, duration, infinity_path, straight, interval=interval)


def fig7b(
    rng: np.random.Generator,
    noise: HandNoise | None = None,
    opening: float = np.deg2rad(15.0),
    duration: float = 16.0,
) -> pd.DataFrame:
    """Turn the tip about the fixed point (-15, -20, 140) mm; the cone opens over the first second."""

    def cone(time: Array) -> Array:
        return pointing(opening * np.clip(time, 0.0, 1.0), 2 * np.pi * time / 8.0)

    settings = SteeringSettings(mapping=HIGH_REACH)
    point = constant(-0.015, -0.020, 0.140)
    return steered_by_hand(rng, duration, point, cone, settings=settings, noise=noise)


# --- Fig. 8 ------------------------------------------------------------------------------------------------

FIG8_SCRIPTS = {
    "a": ((0.0, "palm"), (4.0, "fist"), (8.0, "palm")),
    "b": ((0.0, "palm"), (4.0, "thumbs_up"), (8.0, "palm")),
    "c": ((0.0, "palm"), (4.0, "v_sign"), (8.0, "palm")),
    "d": ((0.0, "palm"),),
}
"""Gestures of the four panels of Fig. 8: start [s], name."""


def fig8(rng: np.random.Generator, panel: str, settings: SteeringSettings | None = None) -> pd.DataFrame:
    """Change gestures with a hand that never stops turning (tilt 7 to 23 degrees)."""

    def direction(time: Array) -> Array:
        tilt = np.deg2rad(15.0 + 8.0 * np.sin(2 * np.pi * time / 5.0))
        return pointing(tilt, 2 * np.pi * time / 6.0)

    position = constant(0.010, -0.008, 0.115)
    return steered_by_hand(rng, 12.0, position, direction, FIG8_SCRIPTS[panel], settings)


def direction_steps(table: pd.DataFrame) -> Array:
    """Return the turn of the tip between frames, scaled to the control period: (n - 1,) [deg]."""
    alpha, gamma = np.tan(np.deg2rad(table["alpha_deg"])), np.tan(np.deg2rad(table["gamma_deg"]))
    direction = np.column_stack([alpha, gamma, np.ones(len(table))])
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    cosine = np.sum(direction[1:] * direction[:-1], axis=1)
    return np.degrees(np.arccos(np.clip(cosine, -1, 1))) * CONTROL_PERIOD / np.diff(table["time_s"])


# --- Fig. 9 ------------------------------------------------------------------------------------------------


def fig9(rng: np.random.Generator) -> pd.DataFrame:
    """Steer at random and note the rate of the loop, without and with the servo bus.

    The rate is simulated, not timed: a loop takes the newest frame, computes, and, with servos, waits for the
    bus.

    Returns
    -------
    DataFrame
        ``loop`` ("no servos", "servo bus"), ``time_s``, ``rate_hz``.
    """
    bus = ServoBus()
    stamps = steering_recording(rng, 130.0)["timestamp_us"].to_numpy() * 1e-6
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
        seen = max(newest, seen + 1)
        if seen >= len(stamps):
            return np.array(starts)
        starts.append(max(free, float(stamps[seen])))
        free = starts[-1] + busy


# --- helpers -----------------------------------------------------------------------------------------------


def _turns(rest: tuple[float, float, float], vectors: Array) -> Array:
    """Return the rotation vectors (n, 3) that turn the unit vector ``rest`` into each of ``vectors``."""
    axis = np.cross(rest, vectors)
    sine = np.linalg.norm(axis, axis=1, keepdims=True)
    angle = np.arctan2(sine, vectors @ np.array(rest)[:, None])
    return np.where(sine > 1e-12, axis / np.maximum(sine, 1e-12) * angle, 0.0)
