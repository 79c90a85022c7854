"""The experiments of Stroppa et al.: the task, its simulated trials, the factorial, the demonstrations.

``load_trials`` brings recorded trials into the same metrics and figures.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(
    __name__, submod_attrs={"trials": ["load_trials", "trial_table"]}
)
