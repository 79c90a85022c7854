"""The control laws of the four papers, one look or sample at a time.

- Lai et al.: `gesture_steering` (Algorithm 1), on `hand_gate`, `gestures` (Eqs. (17)-(18)), `hand_mapping`
  (Eqs. (4)-(5), (19)-(20)), `steering_step` (Eqs. (25)-(27), (29)) and `obstacles`;
- Stroppa et al.: `shared_control` (Table 1, Eqs. (1)-(8), Figs. 4-5);
- Wang et al.: `hybrid` (Eqs. (24)-(26), (28)-(29)) and `actuation_map` (Eq. (27), Sec. IV-E);
- Vervloet: `virtual_stiffness` (Eqs. (8)-(11), (17)-(22), Algorithms 1-2) and `handover` (Algorithm 3).

Here belongs what could run beside a real arm. Who moves the hand, and what a law is compared with, belongs to
``soro_lib/papers/<slug>``.
"""

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
