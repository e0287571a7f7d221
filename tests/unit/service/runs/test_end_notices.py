"""End notices arrive at least once, or the campaign says why not."""

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from pydantic import ValidationError

from risk_sac.config import CampaignSpec
from risk_sac.errors import ConfigError
from risk_sac.execution.evaluate import evaluate
from risk_sac.records import EndNotice, State
from service.runs.end_notices import EndNotices, check_allowed
from tests.receiver import Receiver

SOON_S = (0.0, 0.0)


@pytest.fixture
def receiver(request: pytest.FixtureRequest) -> Iterator[Receiver]:
    receiver = Receiver(*getattr(request, "param", ()))
    yield receiver
    receiver.close()


@contextmanager
def delivering(store, ledger, allowed: list[str]) -> Iterator[None]:
    notices = EndNotices(store, ledger, threading.RLock(), allowed, SOON_S)
    notices.start()
    try:
        yield
    finally:
        notices.stop()


def posted(ledger, url: str) -> Any:
    spec = CampaignSpec(families=("low",), methods=("random",), label="nightly", on_end=url)
    return ledger.create(spec, base_url="http://here/")


def end(ledger, campaign) -> None:
    (run,) = campaign.runs
    ledger.start_run(run.number)
    ledger.end_run(run.number, State.FAILED, "the ego is gone")


def wait_for(store, campaign, state: str) -> EndNotice:
    deadline = time.monotonic() + 60
    while (notice := store.notice(campaign.number)).state != state:
        assert time.monotonic() < deadline, notice
        time.sleep(0.02)
    return notice


def test_an_ended_campaign_is_told_once_and_one_at_work_is_not(store, ledger, receiver):
    ended, at_work = posted(ledger, f"{receiver.url}/ci"), posted(ledger, f"{receiver.url}/ci")
    end(ledger, ended)
    revision = store.campaign(ended.id).revision
    with delivering(store, ledger, [receiver.url]):
        assert wait_for(store, ended, "delivered").tries == 1
    assert receiver.messages == [
        {
            "campaign": ended.id,
            "label": "nightly",
            "state": "failed",
            "reason": store.campaign(ended.id).reason,
            "headline_kinds": None,
            "headline_kinds_published": None,
            "link": f"http://here/v1/campaigns/{ended.id}",
        }
    ]
    assert store.campaign(ended.id).revision != revision
    assert store.notice(at_work.number) == EndNotice(state="waiting", tries=0, reason=None)


@pytest.mark.parametrize("receiver", [(500, 302)], indirect=True)
def test_a_refused_message_is_sent_again_and_a_redirect_is_not_followed(store, ledger, receiver):
    campaign = posted(ledger, receiver.url)
    end(ledger, campaign)
    with delivering(store, ledger, [receiver.url]):
        assert wait_for(store, campaign, "delivered").tries == 3
    assert receiver.paths == ["/hooks"] * 3


@pytest.mark.parametrize("receiver", [(500, 500, 503)], indirect=True)
def test_after_three_tries_the_campaign_tells_why_it_was_not_delivered(store, ledger, receiver):
    campaign = posted(ledger, receiver.url)
    end(ledger, campaign)
    with delivering(store, ledger, [receiver.url]):
        assert wait_for(store, campaign, "failed") == EndNotice(state="failed", tries=3, reason="the answer was 503")
    assert len(receiver.messages) == 3


def test_another_server_goes_on_with_what_is_undelivered(store, ledger, receiver):
    campaign = posted(ledger, receiver.url)
    end(ledger, campaign)
    ledger.note_try(campaign.id, "ConnectError: no route", due_at=time.time() - 1)
    with delivering(store, ledger, [receiver.url]):
        assert wait_for(store, campaign, "delivered").tries == 2
    ledger.delete(campaign.id)
    assert store.notice(campaign.number) is None
    ledger.note_try(campaign.id, None)  # deleted while it was on its way


def test_a_campaign_on_the_command_line_has_no_server_that_tells_its_end(tmp_path):
    spec = CampaignSpec(families=("low",), methods=("random",), on_end="https://hooks.example/ci")
    with pytest.raises(ConfigError, match=r"on_end: 'https.* on the command line; leave it out, or post"):
        evaluate(spec, tmp_path / "out", "", 1, lambda *_: None, "local", 0)
    assert not (tmp_path / "out").exists()


def test_a_url_is_allowed_below_a_prefix_of_the_same_origin():
    allowed = ["https://hooks.example/ci", "http://[::1]:8080"]
    for url in ("https://hooks.example/ci", "https://HOOKS.example:443/ci/7?key=a", "http://[::1]:8080/any"):
        check_allowed(url, allowed)
    for url in (
        "http://hooks.example/ci",
        "https://hooks.example.evil/ci",
        "https://hooks.example:444/ci",
        "https://hooks.example/cinema",
        "http://[::1]/any",
    ):
        with pytest.raises(ConfigError, match=r"on_end: got .*a URL below one of https://hooks"):
            check_allowed(url, allowed)
    with pytest.raises(ConfigError, match=r"on_end: got .*allows none by RISK_SAC_ON_END; leave it out"):
        check_allowed("https://hooks.example/ci", [])


@pytest.mark.parametrize(
    "url",
    ["ftp://a/b", "https://", "https://a@b/c", "http://a/%2e%2e/b", "http://a:x/", "http://a\\b", "http://[1/", "a b"],
)
def test_what_parsers_read_differently_is_no_url_of_a_campaign(url):
    with pytest.raises(ValidationError, match="an http or https URL") as refused:
        CampaignSpec(families=("low",), on_end=url)
    assert refused.value.error_count() == 1
