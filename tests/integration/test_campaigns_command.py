"""`risk-sac campaigns` against a real server."""

import contextlib
import functools
import json
import os
import signal
import socket
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import sumo_nets
from risk_sac import cli
from risk_sac.client import Client
from service.keys import KeyFile, Scope
from tests.server import LONG_S, Service

SUBMIT = ["submit", "--scenario", "low", "--methods", "random", "--seeds", "2", "--episodes", "6"]
LONG = ["submit", "--scenario", "low", "--methods", "random", "--episodes", "5000"]
FAILS = 3  # a seed with which the scripted worker ends with an error


@pytest.fixture(scope="module")
def service(striking: Service) -> Service:
    return striking


@pytest.fixture
def call(service: Service, monkeypatch: pytest.MonkeyPatch) -> Callable[..., int]:
    monkeypatch.setenv("RISK_SAC_URL", f"http://127.0.0.1:{service.port}")
    return lambda *arguments: cli.main(["campaigns", *map(str, arguments)])


@pytest.fixture
def answer(call: Callable[..., int], capsys: pytest.CaptureFixture[str]) -> Callable[..., Any]:
    """Returns the JSON document that is all that a command prints."""

    def answered(*arguments: object, status: int = 0) -> Any:
        capsys.readouterr()
        assert call(*arguments, "--json") == status
        return json.loads(capsys.readouterr().out)

    return answered


def newest(answer: Callable[..., Any]) -> list[str]:
    """Returns the id of the campaign queued last, if there is one."""
    return [campaign["id"] for campaign in answer("list", "--limit", 1)]


@pytest.fixture(scope="module")
def finished(service: Service) -> str:
    """The id of a campaign that found failures in every second episode."""
    return service.wait(service.post(seeds=[0, 1], budget={"episodes": 6}))["id"]


def test_submit_watch_shows_the_way_on_one_channel_and_the_results_on_the_other(call, capsys):
    assert call(*SUBMIT, "--watch", "--max-ecr", 0.1) == 1
    printed = capsys.readouterr()
    assert "succeeded: 12/12 episodes" in printed.err
    assert "ECR above 0.1: low random 0.500" in printed.err
    assert "\x1b" not in printed.err + printed.out
    row, *_ = (line for line in printed.out.splitlines() if "random" in line)
    assert row.split() == ["low", "random", "-", "12", "6", "4", "2", "(2)", "0.50", "0.17"]
    (row,) = (line for line in printed.out.splitlines() if "no_contact" in line)
    assert row.split() == ["no_contact", "failure", "6", "6", "4", "2", "2", "0.500", "[0.254,", "0.746]"]


def test_rates_that_may_be_above_the_bound_are_exit_status_1_unless_the_rate_is_judged(
    finished, call, capsys, tmp_path
):
    assert call("results", finished, "--max-ecr", 0.5) == 1
    assert "interval up to 0.746" in capsys.readouterr().err
    assert call("results", finished, "--max-ecr", 0.75) == 0
    assert call("results", finished, "--max-ecr", 0.5, "--judge-by", "rate") == 0
    assert call("watch", finished, "--max-ecr", 0.49) == 1
    assert call("results", finished, "--max-rate", "no_contact=0.75") == 0
    assert call("results", finished, "--max-rate", "no_contact=0.49", "--judge-by", "rate") == 1
    file = tmp_path / "deeply" / "nested" / "junit.xml"
    assert call("results", finished, "--max-pcr", 0.16, "--judge-by", "rate", "--junit", file) == 1
    (failure,) = ElementTree.parse(file).getroot().iter("failure")
    assert failure.attrib["message"].startswith("PCR above 0.16: 0.167")
    assert (failure.text or "").splitlines()[1].startswith("low-random-0-search-1: ")


def test_a_requirement_that_no_family_has_is_refused_before_anything_is_queued(finished, call, answer, capsys):
    wrong = ("--max-rate", "never_fast=0.1")
    before = newest(answer)
    for arguments in (
        ["results", finished, *wrong],
        ["watch", finished, *wrong],
        [*SUBMIT, "--watch", *wrong],
        ["failures", "list", finished, "--requirement", "never_fast"],
    ):
        capsys.readouterr()
        assert call(*arguments) == 2
        printed = capsys.readouterr().err
        assert "never_fast" in printed
        assert "no_contact" in printed
    assert newest(answer) == before


def test_a_campaign_that_failed_could_not_run_and_says_why(answer, call, capsys, tmp_path):
    file = tmp_path / "junit.xml"
    arguments = ["submit", "--scenario", "low", "--methods", "random", "--first-seed", FAILS, "--episodes", 6]
    results = answer(*arguments, "--watch", "--junit", file, status=2)
    assert results["state"] == "failed"
    (error,) = ElementTree.parse(file).getroot().iter("error")
    assert error.attrib["message"].startswith("failed: ")
    assert call("results", results["campaign_id"]) == 2
    assert f"low-random-{FAILS}: " in capsys.readouterr().err


def test_results_of_a_campaign_that_goes_on_are_shown_and_not_judged_until_it_is_cancelled_and_deleted(
    answer, call, capsys
):
    campaign = answer(*LONG)["id"]
    assert call("results", campaign) == 0
    assert "so far" in capsys.readouterr().out
    assert call("results", campaign, "--max-ecr", 1) == 2
    assert call("watch", campaign, "--timeout", 0.5) == 2
    assert "it goes on" in capsys.readouterr().err
    assert call("delete", campaign) == 2
    assert "answered 409" in capsys.readouterr().err
    assert answer("cancel", campaign, "--wait")["state"] == "cancelled"
    assert call("watch", campaign) == 2
    assert "was cancelled" in capsys.readouterr().err
    assert answer("delete", campaign) == {"id": campaign, "deleted": True}
    assert call("results", campaign) == 2
    assert "answered 404" in capsys.readouterr().err


def test_list_is_newest_first_filtered_and_bounded(answer, call, capsys, monkeypatch):
    hostile = "one\x1b[31m \u202e[bold]two\n\u009b"
    ids = [answer(*SUBMIT, "--label", label)["id"] for label in ("x", "x", hostile)]
    assert [each["id"] for each in answer("list", "--limit", 2)] == ids[:0:-1]
    assert [each["id"] for each in answer("list", "--label", "x", "--limit", 2)] == ids[1::-1]
    assert answer("results")["campaign_id"] == ids[-1]  # of the newest, where none is named
    assert answer("list", "--state", "failed", "--scenario", "dense") == []
    assert answer("list", "--label", hostile)[0]["label"] == hostile
    monkeypatch.setenv("COLUMNS", "120")
    for words in (["list"], ["list", "--json"]):
        assert call(*words) == 0
        printed = capsys.readouterr().out
        assert all(word in printed for word in (r"one\u001b[31m", r"\u202e[bold]two"))
        assert not {"\x1b", "\u202e"} & set(printed)
    for campaign in ids:
        answer("cancel", campaign)


def test_a_file_says_what_to_search_flags_go_first_and_a_key_makes_submissions_one(answer, call, tmp_path):
    file = tmp_path / "spec.yaml"
    file.write_text("label: from a file\nfamilies: [low]\nmethods: [random]\nseeds: [4]\nbudget: {episodes: 6}\n")
    given = ("submit", "--spec", file, "--episodes", 7, "--idempotency-key", "k1")
    first, second = (answer(*given) for _ in range(2))
    posted = first["spec"]
    assert (posted["label"], posted["seeds"], posted["budget"]["episodes"]) == ("from a file", [4], 7)
    assert first["id"] == second["id"]
    assert call(*LONG, "--idempotency-key", "k1") == 2


def test_a_campaign_on_an_uploaded_map_is_submitted_by_its_names(service, answer, call, tmp_path):
    net = (Path(sumo_nets.__path__[0]) / "low" / "low.net.xml").read_bytes()
    post = {"content": net, "params": {"label": "ring"}, "headers": {"content-type": "application/xml"}}
    id_ = service.client.post("/v1/networks", **post).raise_for_status().json()["id"]
    file = tmp_path / "spec.yaml"
    file.write_text("network: ring\npattern: car_following\nplace: road\nmethods: [random]\nbudget: {episodes: 1}\n")
    flags = ["--network", id_, "--pattern", "car_following", "--places", "all", "--methods", "random"]
    for arguments in (["--spec", file], [*flags, "--episodes", 1]):
        (family,) = answer("submit", *arguments)["spec"]["families"]
        assert family.startswith("car_following_road_")
    assert call("submit", "--spec", file, "--place", "nowhere") == 2
    service.client.post("/v1/networks", **post | {"content": net + b"<!-- another -->"}).raise_for_status()
    assert call("submit", "--spec", file) == 2  # two maps have this label


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["submit"], "--scenario is missing; "),
        ([*SUBMIT, "--max-ecr", "0.1"], "--max-ecr: got it without --watch"),
        (["submit", "--scenario", "high"], "http://"),  # the service alone knows all names
        (["submit", "--spec", "nowhere.yaml"], "--spec: "),
        (["watch", "c0000"], "http://"),
        (["list", "--state", "asleep"], "http://"),
        (["list", "--url", "nowhere"], "--url: "),
    ],
)
def test_what_cannot_run_is_exit_status_2_without_a_traceback(arguments, complaint, call, capsys):
    assert call(*arguments) == 2
    printed = capsys.readouterr()
    assert printed.err.startswith(complaint)
    assert "Traceback" not in printed.err
    assert printed.out == ""


def test_a_report_that_cannot_be_written_is_known_before_anything_is_queued(answer, call, tmp_path):
    (tmp_path / "file").write_text("")
    before = newest(answer)
    assert call(*SUBMIT, "--watch", "--junit", tmp_path / "file" / "junit.xml") == 2
    assert newest(answer) == before


def test_no_service_is_exit_status_2(monkeypatch, capsys):
    monkeypatch.setitem(Client.__init__.__kwdefaults__, "patience_s", 0.2)
    with socket.create_server(("127.0.0.1", 0)) as probe:
        url = f"http://127.0.0.1:{probe.getsockname()[1]}"
    assert cli.main(["campaigns", "list", "--url", url]) == 2
    assert f"{url} does not answer" in capsys.readouterr().err


def test_the_key_in_the_environment_opens_the_service(serve, monkeypatch, tmp_path, capsys):
    service = serve()
    key = tmp_path / "key"
    key.write_text(KeyFile(service.data_dir / "keys.json").create("p", "", Scope.RUN)[1])
    monkeypatch.setenv("RISK_SAC_URL", f"http://127.0.0.1:{service.port}")
    monkeypatch.setenv("RISK_SAC_API_KEY_FILE", str(key))
    assert cli.main(["campaigns", "list"]) == 0
    monkeypatch.setenv("RISK_SAC_API_KEY", "a-wrong-one")
    assert cli.main(["campaigns", "list"]) == 2
    monkeypatch.delenv("RISK_SAC_API_KEY_FILE")
    monkeypatch.delenv("RISK_SAC_API_KEY")
    assert cli.main(["campaigns", "list"]) == 2
    complaints = capsys.readouterr().err
    assert complaints.count("answered 401") == 2
    assert key.read_text() not in complaints


def test_a_failure_is_named_by_its_number_too(finished, service, call, capsys):
    one, two = service.wait(service.post(budget={"episodes": 6}))["id"], finished
    for named in ("5", "search-5", "low-random-0-search-5"):
        assert call("failures", "show", one, named) == 2
        assert "'low-random-0-search-5' cannot be shown" in capsys.readouterr().err
    for campaign, named, complaint in (
        (two, "5", "is the number of 2 failures; wanted one of low-random-"),
        (two, "search-5", "is the number of 2 failures"),
        (one, "4", "is the number of no failure"),
        (one, "15", "is the number of no failure"),
    ):
        for command in ("show", "bundle"):
            capsys.readouterr()
            assert call("failures", command, campaign, named) == 2
            assert f"FAILURE: got {named}, which {complaint}" in capsys.readouterr().err


def test_a_terminal_shows_a_bar_for_each_run_at_work(service):
    campaign = service.post(seeds=[0, 1], budget={"episodes": 5000})  # until it is seen, however busy the machine
    ours, theirs = os.openpty()
    url = f"http://127.0.0.1:{service.port}"
    command = [sys.executable, "-m", "risk_sac", "campaigns", "watch", campaign, "--url", url]
    environment = os.environ | {"TERM": "xterm-256color", "COLUMNS": "120"}
    process = subprocess.Popen(command, stderr=theirs, stdout=subprocess.DEVNULL, env=environment)
    os.close(theirs)
    shown = b""
    with os.fdopen(ours, "rb", buffering=0) as terminal:
        try:
            while piece := terminal.read(65536):
                shown += piece
                if all(name in shown for name in (b"all runs", b"low-random-0", b"low-random-1")):
                    service.client.post(f"/v1/campaigns/{campaign}/cancel")
        except OSError:  # how Linux ends a terminal whose other side is closed
            pass
    assert process.wait(LONG_S) == 2
    assert service.get(campaign)["state"] == "cancelled"


def test_an_interrupt_says_that_the_campaign_goes_on(service, answer):
    campaign = answer(*LONG)["id"]
    url = f"http://127.0.0.1:{service.port}"
    command = [sys.executable, "-m", "risk_sac", "campaigns", "watch", campaign, "--url", url]
    # A shell's background job ignores it, and so would what it starts.
    heed = functools.partial(signal.signal, signal.SIGINT, signal.SIG_DFL)
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, preexec_fn=heed) as process:
        assert process.stderr is not None
        assert process.stderr.readline().startswith(campaign)
        while process.poll() is None:  # Python drops an interrupt that meets a finaliser: press again
            process.send_signal(signal.SIGINT)
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(5)
        said = process.stderr.read()
    assert process.returncode == 130
    assert f"risk-sac campaigns cancel {campaign}" in said
    assert answer("cancel", campaign, "--wait")["state"] == "cancelled"
