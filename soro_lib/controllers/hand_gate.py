"""Which frames of the tracker to believe.

An optical tracker loses hands, mixes them up, turns palms over for a frame and repeats time stamps. The gate
passes what is sound and names what is not; the controller then keeps its last valid input (Lai et al.,
Section IV-A).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from soro_lib.checks import check_fields
from soro_lib.controllers.hand_mapping import PalmMapping, Vector
from soro_lib.sensing.hand_tracking import NORMAL_LENGTH, HandSample


@dataclass(frozen=True)
class GateSettings:
    """Bounds of belief.

    Parameters
    ----------
    largest_turn : float
        Turn of the palm normal in one frame that is taken for a flip of the tracker [rad].
    flip_frames : int
        Consistent frames after which a turned normal is believed [-].
    largest_jump : float
        Jump of the palm that is taken for another hand [m].
    reset_after : float
        Pause after which filters start anew [s].
    predict_for : float
        How long a lost hand is extrapolated [s]; afterwards it is held. For as long, a palm that jumped is
        taken for another hand and ignored.
    velocity_after : int
        Frames of a new track before its velocity is believed [-].
    """

    largest_turn: float = math.radians(60.0)
    flip_frames: int = 5
    largest_jump: float = 0.060
    reset_after: float = 0.2
    predict_for: float = 0.05
    velocity_after: int = 2

    def __post_init__(self) -> None:
        check_fields(self, above=0)


@dataclass(frozen=True, slots=True)
class GatedHand:
    """What the gate makes of a frame.

    Attributes
    ----------
    valid : bool
        Whether palm and normal may be used.
    reason : str
        Why not, or "" .
    restart : bool
        Whether filters must start anew: another hand, or a long pause.
    palm, normal : tuple of 3 floats
        Palm [m] and unit normal, device frame; the last sound normal where this one is not believed.
    velocity : tuple of 3 floats or None
        Palm velocity [m/s] where it can be believed.
    """

    valid: bool
    reason: str = ""
    restart: bool = False
    palm: Vector = (math.nan, math.nan, math.nan)
    normal: Vector = (math.nan, math.nan, math.nan)
    velocity: Vector | None = None


class HandGate:
    """Pass sound frames of one hand.

    Parameters
    ----------
    mapping : PalmMapping
        Knows the allowed box.
    settings : GateSettings, optional
        Bounds of belief.
    """

    def __init__(self, mapping: PalmMapping, settings: GateSettings | None = None) -> None:
        self.mapping, self.settings = mapping, settings or GateSettings()
        self._time = -math.inf  # last frame whose clock was believed
        self._valid_time = -math.inf  # last frame that passed
        self._hand_id: int | None = None
        self._palm: Vector | None = None
        self._normal: Vector | None = None
        self._odd_normal: Vector | None = None
        self._odd_frames = 0
        self._age = 0

    def update(self, sample: HandSample) -> GatedHand:
        """Judge one frame."""
        if not math.isfinite(sample.time):
            return GatedHand(False, "time stamp is not finite")
        if not sample.time > self._time:
            return GatedHand(False, "time did not advance")
        self._time = sample.time
        if sample.hand_id is None:
            return GatedHand(False, "no hand")
        if not all(map(math.isfinite, (*sample.palm, *sample.normal))):
            return GatedHand(False, "palm or normal is not finite")
        length = math.sqrt(sum(component * component for component in sample.normal))
        if not NORMAL_LENGTH[0] < length < NORMAL_LENGTH[1]:
            return GatedHand(False, f"palm normal has length {length:.3g}")
        if not self.mapping.in_box(sample.palm):
            return GatedHand(False, "palm is outside the allowed box")
        if self._is_other_hand(sample):
            return GatedHand(False, "another hand")
        x, y, z = sample.normal
        return self._passed(sample, (x / length, y / length, z / length))

    def _is_other_hand(self, sample: HandSample) -> bool:
        """Return whether the palm jumped while the hand that is followed was seen a moment ago."""
        if self._palm is None or sample.time - self._valid_time > self.settings.predict_for:
            return False
        return math.dist(sample.palm, self._palm) > self.settings.largest_jump

    def _passed(self, sample: HandSample, normal: Vector) -> GatedHand:
        restart = (
            sample.hand_id != self._hand_id
            or self._palm is None
            or sample.time - self._valid_time > self.settings.reset_after
            or math.dist(sample.palm, self._palm) > self.settings.largest_jump
        )
        if restart:
            self._age, self._odd_frames, self._normal = 0, 0, None
        self._age += 1
        self._hand_id, self._palm, self._valid_time = sample.hand_id, sample.palm, sample.time
        self._normal = self._believed_normal(normal)
        known = self._age > self.settings.velocity_after and math.isfinite(sum(sample.velocity))
        return GatedHand(True, "", restart, sample.palm, self._normal, sample.velocity if known else None)

    def _believed_normal(self, normal: Vector) -> Vector:
        """Refuse a normal that turned over within one frame, until it has stayed so for several."""
        if self._normal is None or _angle(normal, self._normal) <= self.settings.largest_turn:
            self._odd_frames = 0
            return normal
        consistent = self._odd_frames > 0 and self._odd_normal is not None and (
            _angle(normal, self._odd_normal) <= self.settings.largest_turn
        )  # fmt: skip
        self._odd_frames = self._odd_frames + 1 if consistent else 1
        self._odd_normal = normal
        if self._odd_frames < self.settings.flip_frames:
            return self._normal
        self._odd_frames = 0
        return normal


def _angle(first: Vector, second: Vector) -> float:
    """Return the angle [rad] between two unit vectors."""
    return math.acos(min(max(sum(a * b for a, b in zip(first, second)), -1.0), 1.0))
