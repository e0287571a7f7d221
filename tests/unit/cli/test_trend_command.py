"""`risk-sac trend` on folders of campaigns."""

import json
from pathlib import Path

import pytest

from risk_sac import cli
from risk_sac.config import CampaignSpec
from risk_sac.config.spec_file import campaign_yaml
from risk_sac.records import Repetition
from risk_sac.run_folder.results import RunResults, Verified, write_results, write_verified
from tests.builders import run_metrics


def campaign(folder: Path, label: str, *, finished: bool = True, **changes: object) -> str:
    """Writes a replayed campaign of a version of idm-aeb, without failures."""
    fields = {"families": ["low"], "methods": ["archive"], "ego": {"driver": "idm-aeb", "label": label}} | changes
    spec = CampaignSpec.model_validate(fields)
    for run in spec.runs():
        place = folder / "runs" / run.id
        place.mkdir(parents=True)
        told = {"metrics": run_metrics(20, failures=2), "digest": "d" if finished else None}
        software = {"definitions": label.partition(".")[0], "risk-sac": "1.0", "libsumo": "1.28.0"}
        results = RunResults(spec=run, spec_digest=run.digest, finished=finished, versions=software, **told)
        write_results(place, results)
        write_verified(place, Verified(digest="d", code="", versions={}, episodes=dict[int, Repetition]()))
    (folder / "spec.yaml").write_text(campaign_yaml(spec), encoding="utf-8")
    return str(folder)


def test_folders_are_compared_in_their_order(tmp_path, capsys):
    iid = {"episodes": 20}
    folders = [campaign(tmp_path / label, label, iid=iid) for label in ("1.3", "1.4", "2.0")]
    assert cli.main(["trend", *folders, "--json"]) == 0
    (row,) = json.loads(capsys.readouterr().out)["rows"]
    assert [(point["version"], point["campaign_id"]) for point in row["points"]] == list(
        zip(("1.3", "1.4", "2.0"), folders, strict=True)
    )
    assert [point["headline"] for point in row["points"]] == [0, 0, 0]
    assert [point["new"] for point in row["points"]] == [None, [], None]
    assert [point["changed"] for point in row["points"]] == [[], [], ["definitions"]]
    assert {rate["rate"] for point in row["points"] for rate in point["rates"]} == {0.1}


def test_the_table_marks_what_cannot_be_compared_and_fits_80_columns(tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    folders = [campaign(tmp_path / label, label, iid={"episodes": 20}) for label in ("1.3", "2.0")]
    unfinished = campaign(tmp_path / "open", "2.1", finished=False)
    assert cli.main(["trend", *folders, unfinished]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line for line in lines if len(line) > 80 and unfinished not in line] == []
    (marker,) = (at for at, line in enumerate(lines) if "definitions 1 → 2" in line)
    assert any(line.lstrip().startswith("2.0") for line in lines[marker:])
    assert unfinished in "".join(lines).partition("Left out")[2]  # a long path is wrapped


@pytest.mark.parametrize("folders", [("low", "dense"), ("dense", "low")])
def test_other_scenarios_are_refused_in_one_line(folders, tmp_path, capsys):
    made = [campaign(tmp_path / name, "1.3", families=[name]) for name in folders]
    assert cli.main(["trend", *made]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "the same scenarios" in line
