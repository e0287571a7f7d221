from risk_sac import cli
from risk_sac.benchmark.power import Played, method_power, power_of, runs_of
from risk_sac.config import Budget, CampaignSpec, RunSpec
from risk_sac.records import DefectPower
from risk_sac.run_folder.results import Results, write_results

TEXT = """defects,family,method,seed,budget_steps,steps,episodes,detected,signature
latency,low,archive,0,20000,300,3,300,"a, b"
latency,low,archive,1,20000,20000,200,,
speeds,mixed,archive,0,20000,9000,60,9000,a
no-memory,dense,archive,0,20000,100,1,100,a
latency,low,random,0,5000,5000,50,,
"""
RUNS = runs_of(TEXT)


def test_the_power_of_a_budget_is_what_was_detected_within_it() -> None:
    found = method_power("archive", {"low": (9000, 1), "mixed": (9000, 1)}, RUNS)
    assert found.defects == (
        DefectPower(defect="latency", family="low", detected=1, runs=2),
        DefectPower(defect="speeds", family="mixed", detected=1, runs=1),
    )
    assert found.sentences == (
        "Of 2 known defects that it was measured with in low, mixed, this budget detects 1.5 on average; "
        "never found: none.",
        "Seeds that were measured: 1 to 2 of each defect.",
    )
    found = method_power("archive", {"low": (9000, 1), "mixed": (8999, 1)}, RUNS)
    assert (found.expected, found.in_most_seeds, found.never) == (0.5, (), ("speeds",))


def test_steps_of_a_campaign_are_those_of_its_own_episodes_once_there_are_some() -> None:
    spec = CampaignSpec(families=("low",), methods=("archive",), seeds=(0, 1), budget=Budget(episodes=2))
    (before,) = power_of(spec, [], RUNS).methods[0].budgets
    assert (before.runs, before.steps, before.estimated_from) == (2, 200, "benchmark")
    assert power_of(spec, [], RUNS).methods[0].expected == 0.0
    played = [Played("low", "archive", 1, 150, ended=False), Played("low", "archive", 0, 0, ended=False)]
    (found,) = power_of(spec, played, RUNS).methods
    assert (found.budgets[0].steps, found.budgets[0].estimated_from, found.expected) == (300, "campaign", 1.0)
    assert found.sentences[2] == (
        "In low: 2 runs of 2 episodes, which are 300 environment steps at the mean of its own episodes, 150."
    )
    ended = [Played("low", "archive", 1, 150, ended=True), Played("low", "archive", 0, 0, ended=True)]
    (found,) = power_of(spec, ended, RUNS).methods  # a campaign that was cancelled is worth what it has played
    assert (found.budgets[0].steps, found.expected) == (75, 0.0)


def test_the_command_tells_the_power_of_flags_and_of_the_folder_of_a_run(tmp_path, capsys, metrics) -> None:
    file = tmp_path / "detections.csv"
    file.write_text(TEXT)
    assert cli.main(["power", "--families", "low", "--steps", "20000", "--measured", str(file)]) == 0
    assert "Of 1 known defects that it was measured with in low, this budget detects 0.5 on average" in " ".join(
        capsys.readouterr().out.split()
    )
    assert cli.main(["power", "--method", "ddpg", "--measured", str(file)]) == 2
    problem = capsys.readouterr().err
    assert "--method: got 'ddpg', of which nothing was measured in low, mixed, dense; wanted archive, random" in problem
    run = RunSpec(family="low", method="archive", seed=0, budget=Budget(episodes=4))
    done = metrics.model_copy(update={"episodes": 2, "environment_steps": 150})
    write_results(tmp_path, Results(spec=run, spec_digest=run.digest, finished=False, metrics=done))
    assert cli.main(["power", str(tmp_path), "--measured", str(file)]) == 0
    printed = " ".join(capsys.readouterr().out.split())  # 80 columns wrap it
    assert "1 run of 4 episodes, which are 300 environment steps at the mean of its own" in printed
    assert cli.main(["power", str(tmp_path), "--steps", "9"]) == 2
    assert "--steps: RUNS are given beside it; leave one of the two out" in capsys.readouterr().err
