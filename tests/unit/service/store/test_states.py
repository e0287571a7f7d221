import pytest
from hypothesis import given
from hypothesis import strategies as st

from risk_sac.records import State
from service.errors import TransitionError
from service.store.states import TRANSITIONS, advance, campaign_state

Q, R, P, X, C, S, F = State
states = st.sampled_from(State)


@given(states, states)
def test_advance_follows_the_table(current, new):
    if new in TRANSITIONS[current]:
        assert advance(current, new) is new
    else:
        with pytest.raises(TransitionError, match=f"state is {current}; got {new}"):
            advance(current, new)


@pytest.mark.parametrize(
    ("current", "runs", "wanted"),
    [
        (Q, [Q, Q], Q),
        (Q, [R, Q], R),
        (R, [S, Q], R),
        (R, [F, R], R),
        (R, [S, S], S),
        (R, [S, F], F),
        (R, [Q, Q], Q),  # the server stopped
        (R, [P, Q], P),
        (P, [Q, Q], Q),
        (P, [P, S], P),
        (X, [P, C], X),
        (X, [X, C], X),
        (X, [C, S], C),
        (X, [S, S], S),
        (X, [F, C], C),
        (Q, [C, C], C),
        (F, [R, S], F),  # a failed campaign stays failed while its workers leave
    ],
)
def test_campaign_state_follows_from_its_runs(current, runs, wanted):
    assert campaign_state(current, runs) is wanted


@given(states, st.lists(states, min_size=1, max_size=6))
def test_a_campaign_ends_exactly_when_all_its_runs_have(current, runs):
    ended = campaign_state(current, runs).final
    assert ended == (current.final or all(run.final for run in runs))
