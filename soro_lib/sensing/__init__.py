"""How robots and hands are seen: recordings and pictures in, measurements out.

- Lai et al.: `hand_tracking` (recordings of the optical tracker);
- Wang et al., Sec. II-B: `monocular_vision` (Eq. (30)), on `feature_matching` and `bundle_adjustment`;
- Vervloet, Sections 3.2.2-3.2.4: `stereo_vision`, `marker_ring`, `marker_pose` and `handover_vision`, which
  hands a `handover_observation` to the controller;
- `camera`: the pinhole camera that all of them share, and poses of cameras.

Here belongs what would work on a real picture. What the cameras look at is in ``worlds`` and
``soro_lib/papers/<slug>/world``.
"""

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
