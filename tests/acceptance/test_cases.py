"""Replays the inputs of tests/cases on the command line against expectations.

NAME.expected.yaml stands beside its input, NAME.yaml or a map:

command         run, places or submit
why             what the case shows
figures         of results.json: dotted path → [least, most]
every_episode   of each line of episodes.jsonl: dotted path → a value, or [least, most]
said            words among what the run adjusts
differs_without field of the input; without it the episodes are others
refused         message of the run, with exit status 2
patterns        of places: pattern → number of places
network         of submit: folder below sumo_nets, uploaded first
families        of submit: pattern of each family of the campaign
"""

import json
import re
from collections.abc import Callable, Mapping
from functools import reduce
from pathlib import Path
from typing import Any

import pytest
import yaml

import sumo_nets
from risk_sac.cli import main
from risk_sac.records import Adjustment
from risk_sac.run_folder.results import EPISODES
from tests.server import Service, servers

CASES = Path(__file__).parents[1] / "cases"
EXPECTED = ".expected.yaml"
NAMES = sorted(file.name.removesuffix(EXPECTED) for file in CASES.glob(f"*{EXPECTED}"))


def expected_of(name: str) -> dict[str, Any]:
    return yaml.safe_load((CASES / f"{name}{EXPECTED}").read_text("utf-8"))


def input_of(name: str) -> Path:
    [file] = (file for file in CASES.glob(f"{name}.*") if not file.name.endswith(EXPECTED))
    return file


def at(document: Mapping[str, Any], path: str) -> Any:
    return reduce(lambda found, name: found[name], path.split("."), document)


def holds(value: Any, wanted: Any) -> bool:
    return wanted[0] <= value <= wanted[1] if isinstance(wanted, list) else value == wanted


def run(spec: Path, out: Path) -> list[dict[str, Any]]:
    """The episodes of a run."""
    assert main(["run", "--spec", str(spec), "--out", str(out)]) == 0
    return [json.loads(line) for line in (out / EPISODES).read_text().splitlines()]


def check_run(file: Path, expected: Mapping[str, Any], folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    if "refused" in expected:
        assert main(["run", "--spec", str(file), "--out", str(folder / "run")]) == 2
        assert expected["refused"] in capsys.readouterr().err
        return
    episodes = run(file, folder / "run")
    results = json.loads((folder / "run" / "results.json").read_text())
    for path, wanted in expected.get("figures", {}).items():
        assert holds(at(results, path), wanted), (path, at(results, path), wanted)
    for path, wanted in expected.get("every_episode", {}).items():
        assert all(holds(at(episode, path), wanted) for episode in episodes), (path, wanted)
    told, adjusted = capsys.readouterr().err, "; ".join(str(Adjustment(**each)) for each in results["adjustments"])
    for words in expected.get("said", []):
        assert words in told
        assert words in adjusted
    if without := expected.get("differs_without"):
        plain = folder / "plain.yaml"
        plain.write_text(yaml.safe_dump({k: v for k, v in yaml.safe_load(file.read_text()).items() if k != without}))
        assert [each["risk_return"] for each in run(plain, folder / "plain")] != [
            each["risk_return"] for each in episodes
        ]


def check_places(file: Path, expected: Mapping[str, Any], folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["places", str(file), "--json"]) == 0
    found = [place["pattern"] for place in json.loads(capsys.readouterr().out)["places"]]
    assert {pattern: found.count(pattern) for pattern in found} == expected["patterns"]


def check_submit(file: Path, expected: Mapping[str, Any], folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with servers(folder) as start:
        service: Service = start()
        net = Path(sumo_nets.__path__[0]) / expected["network"] / f"{expected['network']}.net.xml"
        label = yaml.safe_load(file.read_text())["network"]
        upload = service.client.post(
            "/v1/networks",
            content=net.read_bytes(),
            params={"label": label},
            headers={"content-type": "application/xml"},
        )
        assert upload.status_code == 201, upload.text
        url = f"http://127.0.0.1:{service.port}"
        assert main(["campaigns", "submit", "--spec", str(file), "--url", url, "--json"]) == 0
        campaign = json.loads(capsys.readouterr().out)
        assert all(re.fullmatch(expected["families"], family) for family in campaign["families"])
        assert service.wait(campaign["id"])["state"] == "succeeded"


CHECKS: Mapping[str, Callable[..., None]] = {"run": check_run, "places": check_places, "submit": check_submit}


@pytest.mark.usefixtures("steering_egos")
@pytest.mark.parametrize("name", NAMES)
def test_a_case_comes_out_as_expected(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    expected = expected_of(name)
    CHECKS[expected["command"]](input_of(name), expected, tmp_path, capsys)
