"""Filters and learned estimators of the four papers: from what was seen to what is believed.

- Lai et al.: `palm_filter` (Eqs. (6)-(16));
- Wang et al.: `extreme_learning_machine` (Eqs. (1)-(17)), `pose_fusion` (Eq. (18)), `visual_strain` (both,
  online), `grating_mask` (an addition), `gaussian_process` (for Eq. (29));
- Vervloet: `handover_filters` (Eqs. (12)-(15)) and `shape_estimation` (Eq. (16)).

Here belongs what could run beside a real arm. How images and recordings become measurements belongs to
``sensing``; what makes the measurements in a simulation, to ``worlds`` and ``soro_lib/papers/<slug>/world``.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(
    __name__,
    submod_attrs={
        "palm_filter": ["PalmFilter"],
        "extreme_learning_machine": ["ExtremeLearningMachine"],
        "grating_mask": ["GratingMask"],
        "pose_fusion": ["InverseVarianceFusion", "fuse_poses"],
        "handover_filters": ["HandoverFilters"],
        "shape_estimation": ["estimate_shape"],
        "visual_strain": ["VisualStrainEstimator", "VisualStrainSettings"],
    },
)
