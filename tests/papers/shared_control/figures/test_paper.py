"""Figures of many trials, with driven ones among them."""

import pytest

from soro_lib.papers.shared_control.experiments.demonstrations import run_demonstrations
from soro_lib.papers.shared_control.experiments.trials import trial_table
from soro_lib.papers.shared_control.figures import paper
from soro_lib.papers.shared_control.figures.paper import fig04_goal_machine, fig05_stiffness_machine


def stars(axes):
    """Values of the driven trials drawn into an axes."""
    lines = [line for line in axes.lines if line.get_marker() == "*"]
    return sorted(float(value) for line in lines for value in line.get_ydata())


def test_driven_trials_are_drawn_where_they_belong(shipped):
    crowd = run_demonstrations(2, 1, trials=1)
    own = trial_table(shipped)
    figure = paper.fig07b_time(crowd, own)
    for axes in figure.axes:
        kind, environment = axes.get_title(loc="left").split(", ")
        fits = own[(own["kind"] == kind) & (own["environment"] == environment)]
        assert stars(axes) == sorted(fits["time_s"])
    anonymous = paper.fig07b_time(crowd, own.assign(kind="own"))
    assert [len(stars(axes)) for axes in anonymous.axes] == [6, 6, 2, 2], "both panels of the environment"
    unfinished = paper.fig09_assistance(crowd, own.assign(finished=0.0))
    assert stars(unfinished.axes[0]) == []
    assert len(stars(paper.fig09_assistance(crowd, own).axes[0])) == 3
    assert sum(len(stars(axes)) for axes in paper.fig08_error_against_time(crowd, own).axes) == 16


@pytest.mark.parametrize("count", [1, 3, 8])
def test_any_folder_of_trials_makes_every_figure(shipped, count):
    table = trial_table(shipped[:count])
    panels = table.groupby(["environment", "kind"]).ngroups
    assert len(paper.fig07a_placement_error(table).axes) == panels
    assert len(paper.fig07b_time(table).axes) == panels
    assert sum(axes.get_visible() for axes in paper.fig08_error_against_time(table).axes) == panels
    guided = table["paradigm"].isin(["assist_as_needed", "fixed_assistance"]).sum()
    assert len(paper.fig09_assistance(table).axes[0].get_xticklabels()) >= guided
    assert len(fig05_stiffness_machine({"a": shipped[1].trace}).axes) == 3
    assert fig04_goal_machine(shipped[5].trace).axes
