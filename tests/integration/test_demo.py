import json
import re
import shlex
from pathlib import Path

from risk_sac import cli
from risk_sac.client import Campaign, Episode, Run
from risk_sac.config import Budget, CampaignSpec
from risk_sac.records import Grade
from service.demo import conclude, draw_command, in_words, main
from tests.builders import collision, episode_record, judgement
from tests.unit.client.scripted_server import PROGRESS
from tests.unit.client.scripted_server import campaign as campaign_json


def campaign(**progress: int) -> Campaign:
    return Campaign.model_validate(campaign_json("succeeded", progress=PROGRESS | progress))


def test_a_demo_that_cannot_be_posted_says_so_and_leaves_no_service(tmp_path, capsys):
    arguments = ["--family", "highway", "--out", str(tmp_path / "demo.json"), "--data-dir", str(tmp_path / "data")]
    assert main(arguments) == 1
    assert "families[0]: Input should be 'low', 'mixed' or 'dense'" in capsys.readouterr().out.replace("\n", "")
    assert not (tmp_path / "demo.json").exists()
    assert "Finished server process" in (tmp_path / "data" / "service.log").read_text()


def test_it_ends_with_the_defect_that_was_found_and_a_command_that_draws_the_failure(tmp_path, capsys, monkeypatch):
    data_dir = tmp_path / "my data"
    arguments = ["--methods", "archive", "--episodes", "5", "--seeds", "523"]
    assert main([*arguments, "--out", str(tmp_path / "demo.json"), "--data-dir", str(data_dir)]) == 0
    found = json.loads((tmp_path / "demo.json").read_text())
    assert all((data_dir / failure["series"]).is_file() for failure in found["failures"])
    printed = capsys.readouterr().out
    *_, drove = (line for line in printed.splitlines() if line.split()[:2] == ["low", "archive"])
    assert sum(map(int, drove.split()[2::2])) == 5  # the headline failures of each in brackets
    assert "planted defect: tailgates: Follows with a headway of 0.3 s, and brakes for an emergency only." in printed
    last = re.fullmatch(r"the defect `tailgates` was found after ([1-5]) episodes by archive", printed.splitlines()[-1])
    (line,) = (line for line in printed.splitlines() if line.startswith("draw one: "))
    program, *command = shlex.split(line.removeprefix("draw one: "))
    assert Path(program).is_file()
    assert command[2].endswith(f"-search-{int(last[1]) - 1}")
    monkeypatch.chdir(tmp_path)
    assert cli.main(command) == 0
    assert (data_dir / "failure.png").read_bytes().startswith(b"\x89PNG")


def test_its_last_line_counts_what_is_worth_a_persons_time_and_no_repeats(capsys):
    assert conclude(campaign(headline=2, distinct_failures=14, distinct_preventable=3, headline_candidates=3)) == 0
    assert capsys.readouterr().out == "headline failures: 2 (of 14 distinct ones, 3 preventable)\n"


def test_it_offers_to_draw_a_preventable_failure_where_there_is_one():
    def failure(index, grade):
        contact = collision(judgement=None if grade is None else judgement(grade))
        record = episode_record(index, collision=contact).model_dump()
        return Episode.model_validate(record | {"id": f"r-search-{index}", "run_id": "r", "wall_s": 1.0})

    searched = campaign().model_copy(update={"runs": [Run.model_construct(id="r")]})
    failures = [failure(3, None), failure(5, Grade.FULL_BRAKING), failure(8, Grade.PREVENTABLE)]
    assert draw_command(searched, failures, Path()).endswith(" r-search-8 --out failure.png")
    assert draw_command(searched, failures[:2], Path()).endswith(" r-search-3 --out failure.png")


def test_it_says_which_search_needed_how_many_episodes():
    spec = CampaignSpec(families=("low",), methods=("archive", "random"), budget=Budget(episodes=200))
    found = Episode.model_validate(
        episode_record(30).model_dump() | {"id": "low-archive-0-search-30", "run_id": "low-archive-0", "wall_s": 1.0}
    )
    searched = campaign().model_copy(update={"spec": spec})
    assert in_words("latency", searched, {"low-archive-0": found, "low-random-0": None}) == (
        "the defect `latency` was found after 31 episodes by archive; not within its 200 episodes by random"
    )
