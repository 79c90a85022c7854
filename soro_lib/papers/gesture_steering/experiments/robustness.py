"""What a faulty tracker does to the arm: faults put into a recording, and the tip's recovery."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from soro_lib.controllers.gesture_steering import GestureSteering, SteeringResult, SteeringSettings, replay
from soro_lib.papers.gesture_steering.world.hand import synthetic_recording, wandering
from soro_lib.robots import CableDrivenArm
from soro_lib.sensing.hand_tracking import HandSample, hand_samples

Array = NDArray[np.float64]
Samples = list[HandSample]
Fault = Callable[[Samples], Samples]

EVERY = 4.0
"""Time from one fault to the next [s]."""


def bursts(samples: Sequence[HandSample], lasting: float) -> NDArray[np.bool_]:
    """Return which frames lie in a fault: one of the given length [s] every ``EVERY`` seconds."""
    time = np.array([sample.time for sample in samples])
    return ((time - time[0]) % EVERY >= EVERY / 2) & ((time - time[0]) % EVERY < EVERY / 2 + lasting)


def _within(change: Callable[[HandSample], HandSample], lasting: float) -> Fault:
    def fault(samples: Samples) -> Samples:
        hit = bursts(samples, lasting)
        return [change(sample) if struck else sample for sample, struck in zip(samples, hit)]

    return fault


def _lost(lasting: float, jump: float) -> Fault:
    """Lose the hand; it returns under a new identity, displaced by a ``jump`` [m] that decays in 0.1 s."""

    def fault(samples: Samples) -> Samples:
        hit, found, identity, since = bursts(samples, lasting), [], 100, -np.inf
        for index, (sample, struck) in enumerate(zip(samples, hit)):
            if struck:
                identity += 1 if index and not hit[index - 1] else 0
                since = sample.time
                found.append(HandSample(sample.time))
            elif sample.hand_id is None:
                found.append(sample)
            else:
                x, y, z = sample.palm
                shift = jump * float(np.exp(-(sample.time - since) / 0.1))
                found.append(replace(sample, hand_id=identity, palm=(x + shift, y, z)))
        return found

    return fault


def _moved(sample: HandSample, shift: tuple[float, float, float]) -> HandSample:
    x, y, z = (a + b for a, b in zip(sample.palm, shift))
    return replace(sample, palm=(x, y, z))


def _scaled_normal(sample: HandSample, factor: float) -> HandSample:
    x, y, z = (factor * value for value in sample.normal)
    return replace(sample, normal=(x, y, z))


_NAN = (np.nan, np.nan, np.nan)

FAULTS: dict[str, Fault] = {
    "none": lambda samples: samples,
    "gesture flicker, 60 ms": _within(lambda s: replace(s, fingers=(False,) * 5), 0.06),
    "unknown gesture, 1 s": _within(lambda s: replace(s, fingers=(False, True, False, True, False)), 1.0),
    "palm flip, 30 ms": _within(lambda s: _scaled_normal(s, -1.0), 0.03),
    "loss of 55 ms": _lost(0.055, 0.010),
    "loss of 1 s": _lost(1.0, 0.060),
    "second hand, 30 ms": _within(lambda s: replace(_moved(s, (0.12, 0.0, 0.0)), hand_id=77), 0.03),
    "out of the box, 0.5 s": _within(lambda s: _moved(s, (0.0, 0.35, 0.0)), 0.5),
    "repeated time stamps": lambda samples: [sample for sample in samples for _ in range(2)],
    "clock jumps back": _within(lambda s: replace(s, time=s.time - 1.0), 0.3),
    "NaN palm, 0.2 s": _within(lambda s: replace(s, palm=_NAN), 0.2),
    "infinite normal, 0.2 s": _within(lambda s: replace(s, normal=(np.inf, 0.0, 0.0)), 0.2),
    "normal of length 1.5, 0.2 s": _within(lambda s: _scaled_normal(s, 1.5), 0.2),
}
"""Faults by name: each takes samples and returns what a faulty tracker would have sent."""


def sound_hand(rng: np.random.Generator, duration: float = 24.0) -> Samples:
    """Return the samples of a palm that wanders and tilts without any fault of the tracker."""
    position = wandering(rng, duration, (-0.10, 0.14, -0.10), (0.10, 0.28, 0.10))
    turn = wandering(rng, duration, (-0.25, 0.0, -0.25), (0.25, 0.0, 0.25))
    return list(hand_samples(synthetic_recording(rng, duration, position, turn)))


def run_with_fault(
    samples: Sequence[HandSample], name: str, settings: SteeringSettings | None = None
) -> list[SteeringResult]:
    """Replay samples with a fault of ``FAULTS`` put in."""
    return replay(GestureSteering(CableDrivenArm(), settings), FAULTS[name](list(samples)))


def robustness_table(samples: Sequence[HandSample], settings: SteeringSettings | None = None) -> pd.DataFrame:
    """Compare every faulty run with the sound one.

    Returns
    -------
    DataFrame
        ``fault``, ``unsound_frames``, ``tip_speed_mm_s`` (largest), ``mode_changes`` beyond the sound run's,
        ``deviation_mm`` (largest distance to the sound run's tip), ``recovery_ms`` (longest time after a
        fault until the tip is within 1 mm of the sound run's for good, before the next), ``finite`` (all
        commands).
    """
    sound = run_with_fault(samples, "none", settings)
    rows = [_compared(run_with_fault(samples, name, settings), sound) for name in FAULTS]
    return pd.DataFrame(rows, index=pd.Index(FAULTS, name="fault")).reset_index()


def tip_speeds(results: Sequence[SteeringResult]) -> Array:
    """Return the speeds (n - 1,) of the commanded tip [m/s]; pauses count as the controller counts them."""
    time, tip = _clock(results), np.array([result.tip for result in results])
    moved = np.linalg.norm(np.diff(tip, axis=0), axis=1)
    interval = np.minimum(np.diff(time), 0.1)
    return np.where(interval > 0, moved / np.maximum(interval, 1e-9), np.where(moved > 0, np.inf, 0.0))


def mode_changes(results: Sequence[SteeringResult]) -> int:
    """Return how often the mode changed."""
    return sum(first.mode is not second.mode for first, second in pairwise(results))


def _clock(results: Sequence[SteeringResult]) -> Array:
    """Return the times at which frames counted: a stamp that did not advance adds nothing."""
    return np.maximum.accumulate(np.array([result.time for result in results]))


def _compared(results: Sequence[SteeringResult], sound: Sequence[SteeringResult]) -> dict[str, object]:
    time, reference_time = _clock(results), _clock(sound)
    reference = np.array([result.tip for result in sound])
    tip = np.array([result.tip for result in results])
    expected = np.column_stack([np.interp(time, reference_time, column) for column in reference.T])
    distance = np.linalg.norm(tip - expected, axis=1)
    burst_number, phase = np.divmod(time - time[0] - EVERY / 2, EVERY)
    unsound = np.array([bool(result.reason) for result in results])
    last_unsound = [0.0]
    for burst in range(int((time[-1] - time[0]) / EVERY) + 1):
        member = burst_number == burst
        far = member & (distance > 1e-3) & (phase < EVERY - 0.05)
        fault_end = phase[member & unsound].max(initial=0.0)
        last_unsound.append(max(phase[far].max(initial=0.0) - fault_end, 0.0))
    commands = np.array([[*result.tip, *result.actuation] for result in results])
    return {
        "unsound_frames": int(unsound.sum()),
        "tip_speed_mm_s": tip_speeds(results).max() * 1e3,
        "mode_changes": mode_changes(results) - mode_changes(sound),
        "deviation_mm": distance.max() * 1e3,
        "recovery_ms": 1e3 * max(last_unsound),
        "finite": bool(np.isfinite(commands).all()),
    }
