"""The control laws of the four papers."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(
    __name__,
    submod_attrs={
        "gesture_steering": ["GestureSteering"],
        "shared_control": ["AssistAsNeeded", "FixedAssistance", "GoalSelection"],
        "hybrid": ["HybridController"],
        "handover": ["HandoverController", "HandoverParameters", "SafetyRules"],
        "virtual_stiffness": ["VirtualStiffnessController", "limit_state"],
    },
)
