import json
import re
import shlex
from pathlib import Path

from risk_sac import cli
from risk_sac.client import Campaign, Episode, Run
from risk_sac.records import Grade
from service.demo import draw_command, main
from tests.builders import collision, episode_record, judgement
from tests.unit.client.scripted_server import PROGRESS
from tests.unit.client.scripted_server import campaign as campaign_json


def campaign(**progress: int) -> Campaign:
    return Campaign.model_validate(campaign_json("succeeded", progress=PROGRESS | progress))


def test_a_demo_that_cannot_be_posted_says_so_and_leaves_no_service(tmp_path, capsys):
    arguments = ["--scenario", "highway", "--out", str(tmp_path / "demo.json"), "--data-dir", str(tmp_path / "data")]
    assert main(arguments) == 1
    assert "families[0]: got 'highway'" in capsys.readouterr().out.replace("\n", "")
    assert not (tmp_path / "demo.json").exists()
    assert "Finished server process" in (tmp_path / "data" / "service.log").read_text()


def test_it_ends_with_the_defect_that_was_found_and_a_command_that_draws_the_failure(tmp_path, capsys, monkeypatch):
    data_dir = tmp_path / "my data"
    arguments = ["--methods", "risk-sac-diverse", "--episodes", "60"]
    assert main([*arguments, "--out", str(tmp_path / "demo.json"), "--data-dir", str(data_dir)]) == 0
    found = json.loads((tmp_path / "demo.json").read_text())
    assert all((data_dir / failure["series"]).is_file() for failure in found["failures"])
    printed = capsys.readouterr().out
    *_, drove = (line for line in printed.splitlines() if line.split()[:2] == ["mixed", "risk-sac-diverse"])
    assert sum(map(int, drove.split()[2::2])) == 60  # the headline failures of each in brackets
    assert "planted defect: latency: Sees others where they were 0.5 s ago." in printed
    last = re.fullmatch(
        r"the defect `latency` was found after (\d+) episodes by risk-sac-diverse", printed.splitlines()[-1]
    )
    (line,) = (line for line in printed.splitlines() if line.startswith("draw one: "))
    program, *command = shlex.split(line.removeprefix("draw one: "))
    assert Path(program).is_file()
    assert command[2].endswith(f"-search-{int(last[1]) - 1}")
    monkeypatch.chdir(tmp_path)
    assert cli.main(command) == 0
    assert (data_dir / "failure.png").read_bytes().startswith(b"\x89PNG")


def test_it_offers_to_draw_a_preventable_failure_where_there_is_one():
    def failure(index, grade):
        contact = collision(judgement=judgement(grade))
        record = episode_record(index, collision=contact).model_dump()
        return Episode.model_validate(record | {"id": f"r-search-{index}", "run_id": "r", "wall_s": 1.0})

    searched = campaign().model_copy(update={"runs": [Run.model_construct(id="r")]})
    failures = [failure(3, None), failure(5, Grade.FULL_BRAKING), failure(8, Grade.PREVENTABLE)]
    assert draw_command(searched, failures, Path()).endswith(" r-search-8 --out failure.png")
    assert draw_command(searched, failures[:2], Path()).endswith(" r-search-3 --out failure.png")
