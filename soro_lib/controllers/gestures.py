"""Gestures as modes of motion: which fingers mean what, and when to believe them.

Lai et al., Section III-D, Eqs. (17)-(20).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from enum import StrEnum

from soro_lib.checks import not_negative


class Gesture(StrEnum):
    """The four modes of Lai et al., Fig. 4."""

    PALM = "palm"
    V_SIGN = "v_sign"
    THUMBS_UP = "thumbs_up"
    FIST = "fist"


GESTURES: dict[tuple[bool, ...], Gesture] = {
    (True, True, True, True, True): Gesture.PALM,
    (False, True, True, False, False): Gesture.V_SIGN,
    (True, False, False, False, False): Gesture.THUMBS_UP,
    (False, False, False, False, False): Gesture.FIST,
}
"""Mode by the vector of extended fingers (thumb, index, middle, ring, pinky); Lai et al., Eqs. (17), (18)."""


def gesture_count(fingers: int = 5) -> int:
    """Return how many gestures so many fingers can form: 32, not the paper's 120 = 5! (erratum GS-15)."""
    return 2**fingers


class GestureRule:
    """Decide the mode from finger vectors that flicker.

    Fingers never switch together: most changes pass through vectors that mean something else. So a new mode
    is taken only when its vector has stood for a hold time; unknown vectors keep the mode. Fist and
    thumbs-up, which the tracker confuses and which mean opposite things, need a longer hold between each
    other. A pause in the stream as long as the hold starts the count anew.

    Parameters
    ----------
    hold : float
        Time a vector must stand [s].
    opposite_hold : float
        The same between fist and thumbs-up [s].
    """

    def __init__(self, hold: float = 0.13, opposite_hold: float = 0.25) -> None:
        self.hold = not_negative("GestureRule.hold", hold)
        self.opposite_hold = not_negative("GestureRule.opposite_hold", opposite_hold)
        self.mode = Gesture.PALM
        self._candidate: Gesture | None = None
        self._since = self._seen = -math.inf

    def update(self, time: float, fingers: Sequence[bool]) -> Gesture:
        """Take in the finger vector of one frame at ``time`` [s] and return the mode."""
        candidate = GESTURES.get(tuple(fingers))
        if candidate != self._candidate or time - self._seen > max(self.hold, 0.1):
            self._candidate, self._since = candidate, time
        self._seen = time
        if candidate is not None and candidate != self.mode:
            opposite = {candidate, self.mode} == {Gesture.FIST, Gesture.THUMBS_UP}
            if time - self._since >= (self.opposite_hold if opposite else self.hold):
                self.mode = candidate
        return self.mode
