import pytest
from rich.console import Console

from risk_sac.cli.campaigns.failures import failures_table
from risk_sac.cli.campaigns.gate import Bounds
from risk_sac.cli.campaigns.output import driven_by_table, line, results_table, results_tables
from risk_sac.client import CampaignSummary, Episode, Results
from risk_sac.config import METHODS
from risk_sac.records import NO_CONTACT, Outcome
from tests.builders import collision, episode_record, judgement, violation
from tests.unit.cli.test_gate import TOTAL as ORDINARY
from tests.unit.cli.test_gate import requirements
from tests.unit.client.scripted_server import PROGRESS, campaign

TOTAL = ORDINARY | {
    "family": "dense",
    "runs": 100,
    "episodes": 100_000,
    "raw_collisions": 99_999,
    "failures": 99_999,
    "ecr": 0.999,
    "ecr_low": 0.99,
    "ecr_high": 1.0,
    "distinct_failures": 9_999,
    "preventable": 9_999,
    "distinct_preventable": 9_999,
    "headline": 9_999,
    "pcr": 0.999,
    "pcr_low": 0.99,
    "pcr_high": 1.0,
}


def test_results_of_every_method_fit_80_columns(capsys: pytest.CaptureFixture[str]) -> None:
    place = "car_following_" + "a_street_of_a_town_" * 2 + "0a1b2c3d4e5f"
    totals = [TOTAL | {"method": method} for method in METHODS] + [TOTAL | {"family": place, "method": "sac"}]
    results = {
        "campaign_id": "c1",
        "state": "succeeded",
        "complete": True,
        "headline": 12,
        "runs": [],
        "totals": totals,
    }
    Console(width=80).print(results_table(Results.model_validate(results), Bounds(ecr=0.1)))
    printed = capsys.readouterr().out
    assert "…" not in printed
    assert all(f"{method} " in printed for method in METHODS)
    assert printed.splitlines()[0].strip() == "headline failures: 12"
    assert printed.count("above") == printed.count("100 runs") == len(totals)
    assert place in "".join(line.split()[0] for line in printed.splitlines() if line.strip())


def test_a_rate_that_may_be_above_says_up_to_where(capsys: pytest.CaptureFixture[str]) -> None:
    few = TOTAL | {"method": "sac", "episodes": 60, "failures": 3, "ecr": 0.05, "ecr_low": 0.02, "ecr_high": 0.137}
    results = {"campaign_id": "c1", "state": "succeeded", "complete": True, "runs": [], "totals": [few]}
    Console(width=80).print(results_table(Results.model_validate(results), Bounds(ecr=0.1)))
    printed = capsys.readouterr().out
    assert "up to 0.14" in printed
    assert "above" not in printed


def test_each_requirement_is_a_row_below_its_family_and_method(capsys: pytest.CaptureFixture[str]) -> None:
    own = "keeps_a_distance_of_some_forty_letters_x"
    found = requirements(no_contact=(0.1, 0.2), safe_ttc=(0.3, 0.4), **{own: (0.999, 1.0)})
    totals = [ORDINARY | {"requirements": found}, ORDINARY | {"method": "random"}]  # the latter from before
    results = {"campaign_id": "c1", "state": "succeeded", "complete": True, "runs": [], "totals": totals}
    bounds = Bounds(requirements={"no_contact": 0.15, "safe_ttc": 0.1})
    Console(width=80).print(results_tables(Results.model_validate(results), bounds))
    printed = capsys.readouterr().out
    assert "…" not in printed
    rows = [row.split() for row in printed[printed.index("low sac") :].splitlines()]
    assert rows[1] == ["no_contact", "failure", "12", "12", "2", "0", "0.100", "[0.000,", "0.200]"]
    assert rows[2] == ["may", "be", "above", "0.15"]
    assert rows[3] == ["safe_ttc", "report", "12", "–", "–", "–", "0.300", "[0.000,", "0.400]"]
    assert rows[4] == ["above", "0.1"]
    assert rows[5][0] + rows[6][0] == own
    assert "low random" not in printed


def test_each_method_has_a_line_that_says_what_drove_its_episodes(capsys: pytest.CaptureFixture[str]) -> None:
    drove = {"episodes_driven_by": {"script": 137, "policy": 41, "random": 22}}
    found = {"headline": 9, "headline_driven_by": {"script": 7, "policy": 2}}
    totals = [
        TOTAL | drove | found | {"method": "risk-sac-diverse"},
        TOTAL | drove | {"method": "archive", "headline": None},
    ]
    results = {"campaign_id": "c1", "state": "succeeded", "complete": True, "runs": [], "totals": totals}
    table = driven_by_table(Results.model_validate(results))
    assert table is not None
    Console(width=80).print(table)
    *_, heads, _, diverse, archive, _ = (line.split() for line in capsys.readouterr().out.splitlines())
    assert heads == ["family", "method", "policy", "model", "script", "random"]
    assert diverse == ["dense", "risk-sac-diverse", "41", "(2)", "0", "(0)", "137", "(7)", "22", "(0)"]
    assert archive == ["dense", "archive", "41", "0", "137", "22"]
    assert driven_by_table(Results.model_validate(results | {"totals": [TOTAL]})) is None


def test_a_failure_without_contact_is_listed_by_what_it_violates(capsys: pytest.CaptureFixture[str]) -> None:
    struck = {"collision": collision(judgement=judgement()), "failed": (NO_CONTACT,)}
    told = {"violations": (violation(broke=("red_light",)),), "failed": ("never_fast",)}
    failures = [
        Episode(
            **dict(episode_record(index, Outcome.FAILURE, **each)), id=f"low-sac-0-search-{index}", run_id="", wall_s=0
        )
        for index, each in enumerate((struck, told))
    ]
    Console(width=80).print(failures_table(failures))
    contact, own = capsys.readouterr().out.split("low-sac-0-search-0")[1].split("low-sac-0-search-1")
    assert "no_contact" in contact
    assert "9.0, 2.0" in contact
    assert "never_fast" in own
    assert "9.0 ego: red light" in own


@pytest.mark.parametrize(("count", "said"), [(0, "0 failures"), (1, "1 failure"), (2, "2 failures")])
def test_one_failure_is_no_failures(count: int, said: str) -> None:
    progress = PROGRESS | {"episodes_done": 1, "episodes_total": 1, "failures": count, "distinct_preventable": 1}
    progress |= {"headline_candidates": 3}
    found = CampaignSummary.model_validate(campaign(progress=progress))
    assert line(found).startswith(f"c1 running: 1/1 episode, headline failures: at most 3; {said}, 1 distinct")
