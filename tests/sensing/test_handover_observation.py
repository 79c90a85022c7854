"""What the controller is told."""

import numpy as np
import pytest

from soro_lib.sensing.handover_observation import HandoverObservation


def test_a_look_of_the_wrong_shape_is_named():
    with pytest.raises(ValueError, match="ball must have shape"):
        HandoverObservation(None, None, np.zeros(2))
