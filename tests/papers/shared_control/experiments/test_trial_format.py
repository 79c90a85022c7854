"""The header of a trial file."""

from hypothesis import given, settings
from hypothesis import strategies as st

from soro_lib.controllers.shared_control import PARADIGMS
from soro_lib.papers.shared_control.experiments.trial_format import TrialHeader


@settings(max_examples=25, deadline=None)
@given(
    st.sampled_from(list(PARADIGMS)),
    st.sampled_from(["simulated", "real"]),
    st.text(st.characters(codec="utf-8", exclude_categories=["Cc", "Cs"]), min_size=1, max_size=20),
    st.lists(st.integers(0, 2**31), max_size=4),
    st.floats(1, 1e4),
)
def test_header_survives_writing_and_reading(paradigm, environment, operator, seed, stiffness):
    header = TrialHeader(
        paradigm, environment, operator, seed=tuple(seed), hand_stiffness=stiffness, force_law="program"
    )
    assert TrialHeader.parse(header.text().splitlines()) == header
