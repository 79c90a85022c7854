"""Interactive explorers for JupyterLab; without a browser each shows a static figure instead."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(
    __name__,
    submodules=["arms", "gesture_steering", "shared_control", "soft_handover", "visual_strain_fusion"],
    submod_attrs={"frontend": ["is_live"]},
)
