from pathlib import Path

import pytest

from risk_sac.audit.controls import CONTROLS, IDLE, LADDER, NOBODY
from risk_sac.audit.play import Played, play
from risk_sac.audit.run import parts_of, read, run
from risk_sac.audit.table import markdown, searched
from risk_sac.cli import main
from risk_sac.config import EgoConfig
from tests.builders import collision, judgement


def test_an_audit_plays_every_control_in_parts_of_fifty() -> None:
    parts = parts_of(["low", "dense"], episodes=60, idle_episodes=100)
    assert sum(part.count for part in parts) == 2 * (60 * (len(CONTROLS) - 1) + 100)
    assert len({part.file for part in parts}) == len(parts)
    assert max(part.count for part in parts) == 50


def test_every_ego_meets_the_same_scenes_and_nobody_is_touched_where_nobody_attacks() -> None:
    quiet = play("low", NOBODY, seed=3, first=0, count=3)
    assert [played.index for played in quiet] == [0, 1, 2]
    assert all(played.collision is None for played in quiet)
    slow, quick = (play("low", control, seed=3, first=0, count=3) for control in (LADDER[0], LADDER[2]))
    assert [bool(played.rejected) for played in slow] == [bool(played.rejected) for played in quick]
    assert play("low", LADDER[0], seed=3, first=1, count=2) == slow[1:]


def test_an_audit_goes_on_where_it_was_stopped(tmp_path: Path) -> None:
    [part, *_] = parts_of(["low"], episodes=1, idle_episodes=1)
    told: list[tuple[int, int]] = []
    run([part], tmp_path, 3, 1, lambda done, total: told.append((done, total)))
    file = tmp_path / part.file
    written = file.stat().st_mtime_ns
    run([part], tmp_path, 3, 1, lambda done, total: told.append((done, total)))
    assert told == [(0, 1), (1, 1), (1, 1)]
    assert file.stat().st_mtime_ns == written
    assert read([part], tmp_path, "low", part.control) == play("low", part.control, 3, 0, 1)


def test_the_table_counts_by_grade_and_lists_what_should_not_be() -> None:
    judged = judgement(signature="cut-in")
    hit = collision(other_id="left", time_s=4.0, judgement=judged)
    refused = collision(other_id="left", time_s=4.0, verdicts={"no_sideswipe": False}, judgement=judged)
    played = {("low", control.name): [Played(index=0, steps=150)] for control in CONTROLS}
    played["low", IDLE.name] = [
        Played(index=0, steps=40, mean_cost=0.5, collision=hit),
        Played(index=1, steps=40, mean_cost=0.0, collision=refused),
        Played(index=2, rejected="initial_rss"),
        Played(index=3, steps=70, mean_cost=0.0),
    ]
    page = markdown(["low"], played, ())
    assert "| low | all actions 0 | 4 | 1 | 2 | 0 | 1 (4.6-69.9 %) | 1 | 0.133 |" in page
    assert "| low | all actions 0 | 0 | left | 4.0 | 9.0 | careful | cut-in |" in page
    assert "| low | all actions 0 | 1 | left | 4.0 | 9.0 | no_sideswipe | cut-in |" in page


def test_the_command_writes_its_report(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["--families", "low", "--episodes", "1", "--idle-episodes", "1", "--jobs", "1", "--out", str(tmp_path)]
    assert main(["audit", *arguments]) == 0
    assert "| low | careful | 1 |" in (tmp_path / "audit.md").read_text()
    assert "Written" in capsys.readouterr().out
    assert searched(tmp_path) == []


def test_the_ladder_begins_with_the_slowest_driver() -> None:
    assert [control.ego.reaction_time_s for control in LADDER[:3]] == [1.0, 0.5, 0.1]
    assert LADDER[1].ego == EgoConfig()
