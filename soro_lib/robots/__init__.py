"""The four arms as their papers write them: parameters, limits, kinematics and actuator maps.

- `cable_driven`: Lai et al., Eqs. (1)-(3) and (21)-(24);
- `helix`: Vervloet, Eqs. (6)-(13), on the arcs of :mod:`soro_lib.arcs` (Eqs. (1)-(5)); its motors in
  `helix_motors`;
- `pneumatic`: Wang et al., Eqs. (19)-(23) and (27);
- `soft_growing`: Stroppa et al., supplement, Eqs. (1)-(10);
- `base`: what a controller may ask of any arm, and the one rule for limits;
- `cable_driven_kernels`, `helix_kernels`: the same arms compiled, for loops; tested against the arms above.

Here belongs what a controller may know of an arm. How an arm behaves that is told so, a simulated plant,
belongs to ``soro_lib/papers/<slug>/world``.
"""

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
