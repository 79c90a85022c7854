"""A synthetic hand over an optical tracker: the clock, tremor, transits and losses of real recordings.

The statistics were measured on public recordings of the same kind of device (about 240,000 frames): the
tracker's clock has holes, the tremor is coloured and not white, fingers switch one after another when a
gesture changes, the reported palm shifts meanwhile, and a hand that is lost comes back under a new identity.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, PchipInterpolator
from scipy.spatial.transform import Rotation

from soro_lib.sensing.hand_tracking import DIRECTION, FINGERS, NORMAL, PALM, VELOCITY

Array = NDArray[np.float64]
Path = Callable[[Array], Array]

FINGER_FLAGS = {
    "palm": (True, True, True, True, True),
    "v_sign": (False, True, True, False, False),
    "thumbs_up": (True, False, False, False, False),
    "fist": (False, False, False, False, False),
}
"""Extended fingers (thumb to pinky) of the four gestures; Lai et al., Fig. 4."""


@dataclass(frozen=True)
class HandNoise:
    """How restless the hand and how imperfect the tracker is.

    Parameters
    ----------
    period : float
        Base interval of the tracker's clock [s].
    jitter : float
        Standard deviation of an interval [s].
    hole_every : int
        Every so many intervals one lasts three periods [-].
    doubled : float
        Probability that an interval lasts two periods [-].
    tremor : tuple of 3 floats
        Standard deviation of the palm over one second about a parabola, per device axis [m].
    drift : float
        Standard deviation of the slow wandering of a free arm [m].
    line : float
        Root mean square of the physiological tremor near 7.5 Hz [m].
    white : tuple of 3 floats
        White noise of the tracker, per device axis [m].
    normal : float
        Standard deviation of the palm normal over one second, per axis [rad].
    transit : tuple of 2 floats
        Shortest and longest duration of a gesture change [s].
    transit_shift, transit_turn : float
        How far the reported palm moves [m] and turns [rad] during a gesture change.
    thumb_error : float
        Probability per second that the thumb flag of a thumbs-up drops out for 20 to 90 ms [1/s].
    losses : float
        Tracking losses per second [1/s]; a lost hand returns under a new identity.
    flips : float
        One-frame flips of the palm normal per second [1/s].
    velocity_lag : float
        Delay of the reported palm velocity [s].
    """

    period: float = 8.67e-3
    jitter: float = 0.2e-3
    hole_every: int = 127
    doubled: float = 0.03
    tremor: tuple[float, float, float] = (0.24e-3, 0.28e-3, 0.21e-3)
    drift: float = 3.5e-3
    line: float = 0.03e-3
    white: tuple[float, float, float] = (0.011e-3, 0.019e-3, 0.014e-3)
    normal: float = np.deg2rad(0.84)
    transit: tuple[float, float] = (0.08, 0.19)
    transit_shift: float = 25e-3
    transit_turn: float = np.deg2rad(20.0)
    thumb_error: float = 0.5
    losses: float = 0.0
    flips: float = 0.0
    velocity_lag: float = 0.018

    def __post_init__(self) -> None:
        for field in fields(self):
            value = np.asarray(getattr(self, field.name), dtype=float)
            if not np.all(np.isfinite(value)) or np.any(value < 0):
                raise ValueError(f"HandNoise.{field.name} = {value}, must be finite and >= 0")
        if self.period <= 0:
            raise ValueError(f"HandNoise.period = {self.period}, must be > 0")


QUIET = HandNoise(
    jitter=0.0, doubled=0.0, tremor=(0, 0, 0), drift=0.0, line=0.0, white=(0, 0, 0), normal=0.0,
    transit_shift=0.0, transit_turn=0.0, thumb_error=0.0,
)  # fmt: skip
"""A machine's hand: the same clock holes and transits, no restlessness."""


def synthetic_recording(
    rng: np.random.Generator,
    duration: float,
    position: Path,
    tilt: Path,
    gestures: Sequence[tuple[float, str]] = ((0.0, "palm"),),
    noise: HandNoise | None = None,
) -> pd.DataFrame:
    """Simulate what the tracker would report of a moving hand.

    Parameters
    ----------
    rng : Generator
        Source of every random draw.
    duration : float
        Length of the recording [s].
    position : callable
        Maps times (n,) [s] to intended palm centres (n, 3) [m], device frame.
    tilt : callable
        Maps times (n,) [s] to rotation vectors (n, 3) [rad], device frame, that turn the flat palm's normal
        (0, -1, 0) and its pointing direction (0, 0, -1).
    gestures : sequence of (float, str)
        Start time [s] and name (a key of ``FINGER_FLAGS``), in time order, the first at 0.
    noise : HandNoise, optional
        Restlessness of the hand and faults of the tracker.

    Returns
    -------
    DataFrame
        The columns of a recording (see :func:`soro_lib.sensing.load_hand_recording`).

    Raises
    ------
    ValueError
        If a gesture is unknown or the first does not start at 0.
    """
    noise = noise or HandNoise()
    _check_gestures(gestures)
    time = tracker_clock(rng, duration, noise)
    flags, change = _finger_flags(rng, time, gestures, noise)

    shift = _unsteadiness(rng, time, noise)
    palm = position(time) + shift + change[:, None] * _direction(rng) * noise.transit_shift
    wobble = np.column_stack([coloured_noise(rng, time, noise.normal) for _ in range(3)])
    turn = change[:, None] * _direction(rng) * noise.transit_turn
    hand = Rotation.from_rotvec(wobble + turn) * Rotation.from_rotvec(tilt(time))
    normal, direction = hand.apply([0.0, -1.0, 0.0]), hand.apply([0.0, 0.0, -1.0])
    normal[rng.integers(0, len(time), rng.poisson(noise.flips * time[-1]))] *= -1.0

    table = pd.DataFrame({"timestamp_us": np.round(time * 1e6).astype(np.int64) + 1_000_000})
    table["frame_id"] = np.arange(len(time)) + np.cumsum(rng.random(len(time)) < 0.0024)
    table["hand_id"], table["hand_type"] = 11, "right"
    table["confidence"] = 1.0
    for columns, values in ((PALM, palm * 1e3), (NORMAL, normal), (DIRECTION, direction)):
        table[list(columns)] = values
    table[list(FINGERS)] = flags
    table[list(VELOCITY)] = _reported_velocity(time, palm, noise.velocity_lag) * 1e3
    return _with_losses(rng, table, noise).round(6)


def tracker_clock(rng: np.random.Generator, duration: float, noise: HandNoise) -> Array:
    """Return frame times [s] with jitter, doubled intervals and the periodic hole of three periods."""
    count = int(np.ceil(duration / noise.period)) + 1
    interval = noise.period + noise.jitter * rng.standard_normal(count)
    interval[rng.random(count) < noise.doubled] += noise.period
    interval[noise.hole_every - 1 :: noise.hole_every] = 3 * noise.period
    time = np.concatenate([[0.0], np.cumsum(np.maximum(interval, 0.25 * noise.period))])
    return time[time <= duration]


def coloured_noise(rng: np.random.Generator, time: Array, detrended_sd: float) -> Array:
    """Return tremor whose power falls as frequency to the minus 3.75 between 0.5 and 22 Hz.

    Parameters
    ----------
    rng : Generator
        Source of the phases and amplitudes.
    time : array (n,)
        Sample times [s].
    detrended_sd : float
        Median standard deviation about a parabola in windows of one second, in the unit of the result.

    Returns
    -------
    array (n,)
        One realisation.
    """
    rate = 200.0
    count = int(np.ceil((time[-1] - time[0] + 2.0) * rate))
    series = _shaped(rng, count, rate)
    measured = _detrended_sd(series, int(rate))
    grid = time[0] + np.arange(count) / rate
    return np.interp(time, grid, series * detrended_sd / measured)


def constant(*value: float) -> Path:
    """Return the path that stays at a point."""
    return lambda time: np.tile(value, (len(time), 1))


def wandering(rng: np.random.Generator, duration: float, low: Sequence[float], high: Sequence[float]) -> Path:
    """Return a smooth random path through a box, as a person steering at leisure would take.

    Parameters
    ----------
    rng : Generator
        Draws the way points.
    duration : float
        Time to cover [s].
    low, high : sequences of n floats
        Corners of the box, any unit.

    Returns
    -------
    callable
        Maps times (m,) [s] to (m, n) in the unit of the box; never leaves the box.
    """
    dwell = 1.2  # mean time between way points [s]
    knots = np.cumsum(rng.uniform(0.5 * dwell, 1.5 * dwell, size=int(2 * duration / dwell) + 4)) - dwell
    knots[0] = 0.0
    points = rng.uniform(low, high, size=(len(knots), len(low)))
    return PchipInterpolator(knots, points)


def tracing(corners: Array, speed: float) -> tuple[Path, float]:
    """Return a path along a polygon at a steady pace, slowing to rest at each corner, and its duration [s].

    Parameters
    ----------
    corners : array (n, 3)
        Way points [m].
    speed : float
        Mean speed [m/s].
    """
    corners = np.asarray(corners, dtype=float)
    arrival = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1) / speed)])

    def path(time: Array) -> Array:
        leg = np.clip(np.searchsorted(arrival, time, side="right") - 1, 0, len(arrival) - 2)
        share = np.clip((time - arrival[leg]) / np.diff(arrival)[leg], 0.0, 1.0)
        eased = share**3 * (10 - 15 * share + 6 * share**2)  # minimum jerk
        return corners[leg] + eased[:, None] * (corners[leg + 1] - corners[leg])

    return path, float(arrival[-1])


# --- parts -------------------------------------------------------------------------------------------------


def _check_gestures(gestures: Sequence[tuple[float, str]]) -> None:
    unknown = [name for _, name in gestures if name not in FINGER_FLAGS]
    if unknown:
        raise ValueError(f"unknown gesture {unknown[0]!r}; known: {', '.join(FINGER_FLAGS)}")
    starts = [start for start, _ in gestures]
    if not starts or starts[0] != 0.0 or np.any(np.diff(starts) <= 0):
        raise ValueError(f"gestures must start at 0 s and follow in time, got starts {starts}")


def _direction(rng: np.random.Generator) -> Array:
    """Return a random unit vector (3,)."""
    vector = rng.standard_normal(3)
    return vector / np.linalg.norm(vector)


def _shaped(rng: np.random.Generator, count: int, rate: float) -> Array:
    """Return Gaussian noise (count,) with a power-law spectrum between two frequencies."""
    low, high, exponent = 0.5, 22.0, 3.75
    frequency = np.fft.rfftfreq(count, 1 / rate)
    inside = (frequency >= low) & (frequency <= high)
    amplitude = np.where(inside, np.maximum(frequency, low) ** (-exponent / 2), 0.0)
    phase = rng.standard_normal((2, len(frequency)))
    return np.fft.irfft(amplitude * (phase[0] + 1j * phase[1]), count)


def _detrended_sd(series: Array, window: int) -> float:
    """Return the median standard deviation about a parabola over consecutive windows."""
    blocks = series[: len(series) // window * window].reshape(-1, window)
    basis = np.polynomial.legendre.legvander(np.linspace(-1, 1, window), 2)
    trend = basis @ np.linalg.lstsq(basis, blocks.T, rcond=None)[0]
    return float(np.median(np.std(blocks.T - trend, axis=0)))


def _unsteadiness(rng: np.random.Generator, time: Array, noise: HandNoise) -> Array:
    """Return tremor, drift, physiological line and white noise (n, 3) [m]."""
    parts = np.column_stack([coloured_noise(rng, time, sd) for sd in noise.tremor])
    knots = np.arange(time[0], time[-1] + 12.0, 4.0)
    parts += CubicSpline(knots, noise.drift * rng.standard_normal((len(knots), 3)))(time)
    phase = rng.uniform(0, 2 * np.pi, 3)
    parts += np.sqrt(2) * noise.line * np.sin(2 * np.pi * 7.5 * time[:, None] + phase)
    return parts + rng.standard_normal(parts.shape) * np.asarray(noise.white)


def _finger_flags(
    rng: np.random.Generator, time: Array, gestures: Sequence[tuple[float, str]], noise: HandNoise
) -> tuple[NDArray[np.bool_], Array]:
    """Return finger flags (n, 5) and, per frame, how much a change of gesture is under way (0 to 1)."""
    flags = np.tile(FINGER_FLAGS[gestures[0][1]], (len(time), 1))
    change = np.zeros(len(time))
    for start, name in gestures[1:]:
        transit = rng.uniform(*noise.transit)
        for finger, instant in enumerate(start + transit * rng.permutation(np.linspace(0, 1, 5))):
            flags[time >= instant, finger] = FINGER_FLAGS[name][finger]
        change += np.exp(-0.5 * ((time - start - transit / 2) / 0.08) ** 2)
    ends = [start for start, _ in gestures[1:]] + [time[-1]]
    for (start, name), end in zip(gestures, ends):
        if name == "thumbs_up":
            for instant in rng.uniform(start, end, rng.poisson(noise.thumb_error * (end - start))):
                flags[(time >= instant) & (time < instant + rng.uniform(0.02, 0.09)), 0] = False
    return flags, np.minimum(change, 1.0)


def _reported_velocity(time: Array, palm: Array, lag: float) -> Array:
    """Return the tracker's own, delayed velocity (n, 3) [m/s]; zero on the first frame."""
    velocity = np.gradient(palm, time, axis=0)
    late = np.column_stack([np.interp(time - lag, time, column) for column in velocity.T])
    late[0] = 0.0
    return late


def _with_losses(rng: np.random.Generator, table: pd.DataFrame, noise: HandNoise) -> pd.DataFrame:
    """Blank out tracking losses; the hand returns with a new identity and, one time in five, as the left."""
    time = (table["timestamp_us"] - table["timestamp_us"].iloc[0]).to_numpy() * 1e-6
    table["hand_id"] = table["hand_id"].astype("Int64")
    hand = [column for column in table.columns if column not in ("timestamp_us", "frame_id")]
    table[hand[2:]] = table[hand[2:]].astype(float)
    unseen = np.zeros(len(time), dtype=bool)
    for instant in np.sort(rng.uniform(0.5, time[-1], rng.poisson(noise.losses * time[-1]))):
        lasting = 0.055 if rng.random() < 0.7 else rng.uniform(0.4, 1.2)
        lost, after = (time >= instant) & (time < instant + lasting), time >= instant + lasting
        table.loc[after, "hand_id"] = int(table["hand_id"].max()) + 1
        table.loc[after, "hand_type"] = "left" if rng.random() < 0.2 else "right"
        jump = _direction(rng) * (10.0 if lasting < 0.1 else 60.0)
        table.loc[after, list(PALM)] += jump * np.exp(-(time[after] - instant) / 1.0)[:, None]
        unseen |= lost
    table.loc[unseen, hand] = pd.NA
    return table
