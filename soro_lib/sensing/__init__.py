"""What the robots and their operators are seen and felt with: hand tracking, fibre gratings, cameras."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(
    __name__,
    submod_attrs={
        "fibre": ["FibreGratings"],
        "hand_tracking": ["HandSample", "hand_samples", "load_hand_recording"],
        "monocular_vision": ["MonocularTracker", "fit_similarity"],
        "rendering": ["Camera", "Photometry", "Polygon", "TexturedQuad", "expose", "render"],
        "round_bodies": ["Sphere", "Tube"],
        "stereo_vision": ["triangulate"],
    },
)
