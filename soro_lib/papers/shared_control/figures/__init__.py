"""Figures of the shared-control paper, one function per figure, named after the paper's numbers."""

from soro_lib.papers.shared_control.figures.operators import (
    dwell,
    lifts,
    misdetection,
    sensitivity,
    tracking_noise,
)
from soro_lib.papers.shared_control.figures.results import (
    claim_matrix,
    fig07a_placement_error,
    fig07b_time,
    fig08_error_against_time,
    fig09_assistance,
)
from soro_lib.papers.shared_control.figures.trials import (
    counter_readings,
    fig02_task,
    fig04_goal_machine,
    fig05_stiffness_machine,
    printed_counter,
)
from soro_lib.papers.shared_control.figures.tuning import (
    anova_comparison,
    blend_surface,
    implied_scatter,
    passivity,
    stability,
)

__all__ = [
    "anova_comparison",
    "blend_surface",
    "claim_matrix",
    "counter_readings",
    "dwell",
    "fig02_task",
    "fig04_goal_machine",
    "fig05_stiffness_machine",
    "fig07a_placement_error",
    "fig07b_time",
    "fig08_error_against_time",
    "fig09_assistance",
    "implied_scatter",
    "lifts",
    "misdetection",
    "passivity",
    "printed_counter",
    "sensitivity",
    "stability",
    "tracking_noise",
]
