"""The four arms: parameters, kinematics, limits, actuator maps and simulated plants."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(
    __name__,
    submod_attrs={
        "cable_driven": ["CableDrivenArm"],
        "helix": ["HelixArm"],
        "helix_plant": ["AngleLossPlant", "ElasticPlant"],
        "pneumatic": ["PneumaticArm"],
        "pneumatic_plant": ["BackboneParameters", "ChamberParameters", "PneumaticPlant"],
        "base": ["ActuationError", "ActuationWarning", "ClippedActuation", "Robot"],
        "soft_growing": ["SoftGrowingArm", "redistribute_actuation"],
        "soft_growing_plant": ["PlantParameters", "SoftGrowingPlant", "real_arm"],
    },
)
