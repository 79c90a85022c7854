"""Filters and learned estimators of the four papers."""

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
