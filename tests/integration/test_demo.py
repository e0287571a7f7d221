import json
import shlex
from pathlib import Path

from risk_sac import cli
from risk_sac.config import METHODS
from service import demo
from service.demo import main


def test_a_demo_that_cannot_be_posted_says_so_and_leaves_no_service(tmp_path, capsys):
    arguments = ["--family", "highway", "--out", str(tmp_path / "demo.json"), "--data-dir", str(tmp_path / "data")]
    assert main(arguments) == 1
    assert "families[0]: Input should be 'low', 'mixed' or 'dense'" in capsys.readouterr().out.replace("\n", "")
    assert not (tmp_path / "demo.json").exists()
    assert "Finished server process" in (tmp_path / "data" / "service.log").read_text()


def test_the_command_it_ends_with_draws_a_failure(tmp_path, capsys, monkeypatch):
    data_dir = tmp_path / "my data"
    arguments = ["--family", "low", "--methods", "bo-only", "--episodes", "40", "--seeds", "78"]
    assert main([*arguments, "--out", str(tmp_path / "demo.json"), "--data-dir", str(data_dir)]) == 0
    found = json.loads((tmp_path / "demo.json").read_text())
    assert all((data_dir / failure["series"]).is_file() for failure in found["failures"])
    printed = capsys.readouterr().out
    (line,) = (line for line in printed.splitlines() if line.startswith("draw one: "))
    program, *command = shlex.split(line.removeprefix("draw one: "))
    assert Path(program).is_file()
    monkeypatch.chdir(tmp_path)
    assert cli.main(command) == 0
    assert (tmp_path / "failure.png").read_bytes().startswith(b"\x89PNG")


def test_without_a_failure_it_offers_none_to_draw(capsys):
    demo._invite({"campaign": {"id": "c", "runs": [{"id": "low-random-0"}]}, "failures": []}, Path(), demo.Console())
    assert capsys.readouterr().out == ""


def test_summary_of_every_method_fits_80_columns(capsys):
    total = {
        "episodes": 10_000,
        "raw_collisions": 999,
        "failures": 999,
        "distinct_failures": 777,
        "distinct_preventable": 555,
        **dict.fromkeys(("ecr", "pcr", "pcr_low", "pcr_high"), 0.5),
    }
    totals = [total | {"method": method} for method in METHODS]
    demo._summarise({"results": {"totals": totals}}, demo.Console(width=80))
    printed = capsys.readouterr().out
    assert "…" not in printed
    assert all(method in printed for method in METHODS)
    assert printed.count(" 777 ") == printed.count(" 555 ") == len(METHODS)
    assert "distinct" in printed


def test_its_last_line_counts_what_is_worth_a_persons_time_and_no_repeats(capsys):
    campaign = {"state": "succeeded", "reason": None, "progress": {"distinct_failures": 14, "distinct_preventable": 3}}
    assert demo._verdict({"campaign": campaign}, demo.Console(width=80)) == 0
    assert capsys.readouterr().out == "distinct failures: 14; a careful driver would have prevented: 3\n"


def test_it_offers_to_draw_a_preventable_failure_where_there_is_one(capsys):
    def failure(index, grade):
        judgement = None if grade is None else {"grade": grade}
        id_ = f"low-random-0-train-{index}"
        return {"id": id_, "run_id": "low-random-0", "index": index, "collision": {"judgement": judgement}}

    campaign = {"id": "c", "runs": [{"id": "low-random-0"}]}
    failures = [failure(3, None), failure(5, "ideal"), failure(8, "careful")]
    for known, drawn in ((failures, "low-random-0-train-8"), (failures[:2], "low-random-0-train-3")):
        demo._invite({"campaign": campaign, "failures": known}, Path(), demo.Console())
        assert f" {drawn} --out failure.png" in capsys.readouterr().out
