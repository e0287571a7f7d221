"""What was told of a run's failures, beside its results."""

import math
import os
from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from risk_sac.failures import play
from risk_sac.failures.minimise import _reduce_actions, without
from risk_sac.failures.question import TwinPlay, read_twin, twin_bytes
from risk_sac.failures.studied import STUDIES, Core, Extent, Studied, note, read_studies
from risk_sac.failures.variants import Variant, alike
from risk_sac.records import Collision, ConflictType, EpisodeRecord, Grade, Outcome
from risk_sac.report.runs import vendi
from tests.builders import collision, episode_record, judgement, violation
from tests.unit.failures.staged import synthetic_series


class Needs:
    """A failure that needs some of its units; counts what is tried."""

    def __init__(self, units: Sequence[int], needed: set[int]) -> None:
        self.left, self.needed, self.tried = set(units), needed, 0

    def unneeded(self, chunk: Sequence[int]) -> bool:
        self.tried += 1
        assert set(chunk) <= self.left, "tried again what is gone already"
        if self.needed & set(chunk):
            return False
        self.left -= set(chunk)
        return True


@pytest.mark.parametrize("needed", [set(), {0}, {11}, {3, 4}, {0, 5, 11}, set(range(12))])
def test_what_is_not_needed_goes(needed):
    failure = Needs(range(12), needed)
    without(range(12), failure.unneeded)
    assert failure.left == needed


def test_what_is_not_needed_together_costs_one_try():
    failure = Needs(range(32), set())
    without(range(32), failure.unneeded)
    assert failure.tried == 1


def test_where_no_action_is_left_nothing_is_weakened():
    family = SimpleNamespace(adversaries=("lead",))
    env = SimpleNamespace(problem=SimpleNamespace(family=family))
    search: Any = SimpleNamespace(stage=SimpleNamespace(env=env, failure=SimpleNamespace(other_id=None)), taken=0)
    search.left = Variant(scene=np.zeros(1), actions=np.ones((10, 2)), seed=0)

    def take(variant):
        search.left = variant
        search.taken += 1
        return search.taken < 20  # so that the test ends

    search.take = take
    _reduce_actions(search)
    assert search.taken == 1


def failure(kind: str, grade: Grade, **changes: float) -> Collision:
    return collision(verdicts={"ego_moving": True}, judgement=judgement(grade, kind=kind), **changes)


def found(*collisions: Collision) -> list[tuple[str, EpisodeRecord]]:
    return [
        (f"e{i}", episode_record(i, Outcome.FAILURE, steps=90 - i, collision=each)) for i, each in enumerate(collisions)
    ]


def test_the_vendi_score_counts_what_has_nothing_in_common():
    one = failure("cut-in", Grade.PREVENTABLE)
    assert vendi([]) == 0.0
    assert vendi([[one] * 7]) == pytest.approx(1.0)
    assert vendi([[one], [one], [one]]) == pytest.approx(3.0)
    near, far = (failure("cut-in", Grade.PREVENTABLE, relative_speed_mps=speed) for speed in (7.5, 20.0))
    assert 1.0 < vendi([[one, near]]) < vendi([[one, far]]) < 2.0


CORE = Core(
    before=Extent(adversaries=2, segments=9, channels=12, strongest=1.0),
    after=Extent(adversaries=1, segments=3, channels=4, strongest=0.5),
    plain_parameters=5,
    parameters=9,
    episodes=100,
    held=9,
    copies=10,
    sentence="A walker steps out",
)


def test_of_other_results_or_damaged_nothing_is_told(tmp_path):
    assert read_studies(tmp_path, "d") == {}
    note(tmp_path, "other", 3, Studied(core=CORE))
    note(tmp_path, "d", 4, Studied(core=CORE))
    for name, content in (("000005-core.json", "{"), ("5.json", "[]"), ("000006-twin.json", "{}")):
        (tmp_path / STUDIES / name).write_text(content)
    (tmp_path / STUDIES / "000004-core.json").rename(tmp_path / STUDIES / "4-x.json")
    assert read_studies(tmp_path, "d") == {}


def test_a_twin_reads_back_with_its_series_and_what_is_not_finite():
    hit = collision(early_min_ttc_s=math.inf)
    play = TwinPlay.of(None, hit, [hit])
    read, series = read_twin(twin_bytes(play, synthetic_series()))
    assert read == play
    assert series.keys() == synthetic_series().keys()
    for name, array in synthetic_series().items():
        np.testing.assert_array_equal(series[name], array)


def test_the_twin_of_a_violation_says_whether_it_keeps_that_requirement():
    broken, hit = violation(), collision(other_id="lead", ego_speed_mps=12.3, relative_speed_mps=1.34)
    assert TwinPlay.of(None, broken, []).outcome == "keeps never_fast"
    assert TwinPlay.of(None, broken, [broken]).outcome == "violates never_fast after 1.5 s, at 9.0 m/s"
    told = TwinPlay.of(None, broken, [hit])
    assert (told.outcome, told.collision) == ("keeps never_fast, touches lead at a closing speed of 1.3 m/s", hit)
    assert TwinPlay.of(None, hit, [broken]).outcome == "no contact, violates never_fast after 1.5 s, at 9.0 m/s"


HIT = collision(other_id="lead", judgement=judgement())
BY_LEAD = violation(other_id="lead", other_role="adversary")


@pytest.mark.parametrize(
    ("wanted", "found"), [(HIT, HIT), (BY_LEAD, BY_LEAD), (BY_LEAD, violation()), (violation(), BY_LEAD)]
)
def test_these_are_alike(wanted, found):
    assert alike([violation(requirement="gentle"), found], wanted) is found


@pytest.mark.parametrize(
    ("wanted", "found"),
    [
        (HIT, BY_LEAD),
        (HIT, collision(other_id="left", judgement=judgement())),
        (HIT, collision(other_id="lead", judgement=judgement(conflict_type=ConflictType.LEADER))),
        (BY_LEAD, HIT),
        (BY_LEAD, violation(requirement="gentle", other_id="lead")),
        (BY_LEAD, BY_LEAD.model_copy(update={"verdicts": {"no_teleport": False}})),
    ],
)
def test_these_are_not(wanted, found):
    assert alike([found], wanted) is None


@pytest.mark.parametrize(("killed", "status", "lines"), [(2, 0, 3), (99, 9, 0)])
def test_a_process_that_is_killed_is_replaced_but_not_for_ever(tmp_path, monkeypatch, killed, status, lines):
    tries = tmp_path / "tries"
    tries.mkdir()

    def tell(file, runs):
        (tries / str(os.getpid())).touch()
        if len(list(tries.iterdir())) <= killed:
            os.kill(os.getpid(), 9)
        with file.open("ab", buffering=0) as output:
            output.write(b"{}\n")

    monkeypatch.setattr(play, "_prepared", lambda file, folders: {})
    monkeypatch.setattr(play, "_tell", tell)
    (tmp_path / "file").touch()
    assert play._main(tmp_path / "file", 3, 1, []) == status
    assert len((tmp_path / "file").read_text().splitlines()) == lines
