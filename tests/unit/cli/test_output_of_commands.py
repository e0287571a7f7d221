"""Output of the commands: it fits 80 columns; --json prints one document."""

import json
from pathlib import Path

import pytest

from risk_sac import cli
from risk_sac.run_folder.results import read_results

ROOT = Path(__file__).parents[3]


@pytest.fixture(autouse=True)
def narrow(monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")


@pytest.mark.parametrize(
    "words",
    [
        "show RUN --raw",
        "show RUN --preventable",
        "clusters RUN",
        "power RUN",
        "power",
        "egos list",
        "egos defects",
        "places NET --why",
    ],
)
def test_output_fits_80_columns(words, folder, capsys):
    places = {"RUN": str(folder), "NET": str(ROOT / "sumo_nets" / "dense" / "dense.net.xml")}
    assert cli.main([places.get(word, word) for word in words.split()]) == 0
    printed = capsys.readouterr().out
    assert printed
    assert [line for line in printed.splitlines() if len(line) > 80] == []
    assert "nothing in common" not in printed


@pytest.mark.parametrize(
    "words", ["show RUN", "show RUN --raw --sort severity", "clusters RUN", "verify RUN --times 1"]
)
def test_json_is_one_document(words, folder, capsys):
    assert cli.main([str(folder) if word == "RUN" else word for word in words.split()] + ["--json"]) == 0
    json.loads(capsys.readouterr().out)


def test_filters_leave_what_they_say(folder, capsys):
    def shown(*flags):
        assert cli.main(["show", str(folder), "--json", "--limit", "1000", *flags]) == 0
        return json.loads(capsys.readouterr().out)

    every = [failure.episode for failure in read_results(folder).failures]
    assert [each["index"] for each in shown("--raw")] == [episode.index for episode in every]
    valid = [episode for episode in every if episode.valid_violations]
    assert [each["index"] for each in shown()] == [episode.index for episode in valid]
    preventable = [episode.index for episode in valid if episode.worst_violation.preventable]
    assert [each["index"] for each in shown("--preventable")] == preventable
    speeds = [each["collision"]["ego_speed_mps"] for each in shown("--raw", "--sort", "speed") if each["collision"]]
    assert speeds == sorted(speeds, reverse=True)
    assert len(shown("--raw", "--limit", "1")) == 1
    assert len(shown("--distinct")) <= len(valid)
