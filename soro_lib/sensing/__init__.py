"""How robots and hands are seen: hand tracking, cameras, markers. What they look at is in ``worlds``."""

import lazy_loader

from soro_lib.moved import old_names

_present, __dir__, __all__ = lazy_loader.attach(
    __name__,
    submod_attrs={
        "camera": ["Camera"],
        "hand_tracking": ["HandSample", "hand_samples", "load_hand_recording"],
        "monocular_vision": ["MonocularTracker", "fit_similarity"],
        "stereo_vision": ["triangulate"],
    },
)
__getattr__ = old_names(__name__, _present)
