"""The four arms: parameters, kinematics, limits and actuator maps. Simulated plants are in ``papers``."""

import lazy_loader

from soro_lib.moved import old_names

_present, __dir__, __all__ = lazy_loader.attach(
    __name__,
    submod_attrs={
        "cable_driven": ["CableDrivenArm"],
        "helix": ["HelixArm"],
        "pneumatic": ["PneumaticArm"],
        "base": ["ActuationError", "ActuationWarning", "ClippedActuation", "Robot"],
        "soft_growing": ["SoftGrowingArm", "redistribute_actuation"],
    },
)
__getattr__ = old_names(__name__, _present)
