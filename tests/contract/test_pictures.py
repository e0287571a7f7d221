"""Pictures of contacts over REST, client and terminal, of known campaigns."""

import json
import secrets
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import contextmanager

import httpx
import numpy as np
import pytest

from risk_sac import cli
from risk_sac.client import Client, Refused, Series
from risk_sac.execution.helper import HelperResult
from risk_sac.failures import show
from risk_sac.failures.question import Question, TwinPlay, twin_bytes
from risk_sac.records import wire
from risk_sac.run_folder.results import FAILURES, series_name
from service.keys import KeyFile, Scope
from service.settings import ServiceSettings
from service.store.database import READERS
from service.views import on_demand
from tests.builders import collision
from tests.contract.recorded_campaigns import ENDED_ID, Recorded, known_times_and_ids
from tests.contract.serving import serving

RUN = "low-risk-sac-3"
FOLDER = f"/v1/campaigns/{ENDED_ID}/failures"


@pytest.fixture(scope="module")
def settings(tmp_path_factory) -> ServiceSettings:
    return ServiceSettings(data_dir=tmp_path_factory.mktemp("pictures"), max_workers=1)


@contextmanager
def recorded(settings: ServiceSettings) -> Iterator[httpx.Client]:
    with known_times_and_ids() as clock:
        Recorded(settings, clock).write()
        with serving(settings) as url, httpx.Client(base_url=url, timeout=600) as client:
            yield client


@pytest.fixture(scope="module")
def client(settings) -> Iterator[httpx.Client]:
    with recorded(settings) as client:
        yield client


@pytest.fixture
def fresh(tmp_path) -> Iterator[httpx.Client]:
    """Of a service that has drawn nothing yet."""
    with recorded(ServiceSettings(data_dir=tmp_path, max_workers=1)) as client:
        yield client


@pytest.fixture(scope="module")
def stubbed_folder(tmp_path_factory):
    return tmp_path_factory.mktemp("stubbed")


@pytest.fixture(scope="module")
def stubbed(stubbed_folder) -> Iterator[httpx.Client]:
    """Client of a service with stubbed drawing; tests ask for different pictures."""
    with recorded(ServiceSettings(data_dir=stubbed_folder, max_workers=1)) as client:
        yield client


@pytest.fixture
def drawn(monkeypatch):
    """Replaces the drawing of pictures: each is ready when its gate opens."""
    begun, gate = [], threading.Event()

    def drawing(family, recording, format_, twin):
        begun.append(recording.failure.id)
        assert gate.wait(600)
        return f"picture {len(begun)}".encode()

    monkeypatch.setattr(show, "recording_bytes", drawing)
    drawing.begun, drawing.gate = begun, gate
    yield drawing
    gate.set()


def ids(client) -> list[str]:
    """Of all contacts, valid or not."""
    return [each["id"] for each in client.get(FOLDER, params={"tier": "raw"}).json()["items"]]


def wait_for(begun: list[str]) -> None:
    while not begun:
        time.sleep(0.01)


@pytest.mark.parametrize(
    ("name", "media_type", "magic"),
    [("picture.png", "image/png", b"\x89PNG"), ("thumbnail.svg", "image/svg+xml", b"<svg ")],
)
def test_every_contact_has_pictures_that_need_not_be_sent_twice(client, name, media_type, magic):
    tags, every = set(), ids(client)
    chosen = every if name.endswith("svg") else [every[0], every[-1]]  # a picture takes a second to draw
    for failure in chosen:
        answer = client.get(f"{FOLDER}/{failure}/{name}")
        assert (answer.status_code, answer.headers["content-type"]) == (200, media_type)
        assert answer.headers["cache-control"] == "no-cache"
        assert answer.content.startswith(magic)
        tags.add(answer.headers["etag"])
        known = {"If-None-Match": answer.headers["etag"]}
        assert client.get(answer.url.path, headers=known).status_code == 304
    assert len(tags) == len(chosen)


def test_what_is_no_contact_has_no_picture(client):
    for path in (f"{FOLDER}/{RUN}-search-0", f"{FOLDER}/x", f"/v1/campaigns/c0/failures/{RUN}-search-1"):
        answer = client.get(f"{path}/picture.png")
        assert (answer.status_code, answer.json()["reason"]) == (404, "unknown_id")


def test_a_contact_whose_series_is_lost_or_damaged_has_no_picture_and_says_so(stubbed, stubbed_folder, drawn):
    drawn.gate.set()
    file = stubbed_folder / "campaigns" / ENDED_ID / RUN / FAILURES / series_name(2)
    content = file.read_bytes()
    for breaking, why in ((lambda: file.write_bytes(content[:-1]), "is damaged"), (file.unlink, "is gone")):
        breaking()
        for picture in ("picture.png", "thumbnail.svg"):
            answer = stubbed.get(f"{FOLDER}/{RUN}-search-2/{picture}")
            assert (answer.status_code, answer.json()["reason"]) == (404, "series_lost")
            assert why in answer.json()["detail"]
            assert str(stubbed_folder) not in answer.text
    file.write_bytes(content)
    for picture in ("picture.png", "thumbnail.svg"):
        assert stubbed.get(f"{FOLDER}/{RUN}-search-2/{picture}").status_code == 200


def others(client) -> list[str]:
    """Paths of pictures, except of the contact whose series is damaged."""
    return [f"{FOLDER}/{failure}/picture.png" for failure in ids(client) if failure != f"{RUN}-search-2"]


def test_a_picture_is_drawn_once_for_all_who_ask_for_it_and_holds_up_nothing_else(stubbed, drawn):
    path = others(stubbed)[0]
    with ThreadPoolExecutor(READERS + 5) as askers:
        answers = [askers.submit(stubbed.get, path) for _ in range(READERS + 5)]
        wait_for(drawn.begun)
        assert stubbed.get("/healthz").status_code == 200
        assert stubbed.get(FOLDER).status_code == 200  # in one of the threads that read the database
        assert not any(answer.done() for answer in answers)
        drawn.gate.set()
        assert len({answer.result().content for answer in answers}) == 1
    stubbed.get(path)
    assert len(drawn.begun) == 1


def test_no_more_than_a_bounded_number_waits_and_others_are_told_when_to_come_back(stubbed, drawn, monkeypatch):
    monkeypatch.setattr(on_demand, "MOST_WAITING", 1)
    first, *rest = others(stubbed)[1:4]
    assert len(rest) == 2
    with ThreadPoolExecutor(3) as askers:
        answers = [askers.submit(stubbed.get, first)]
        wait_for(drawn.begun)
        answers += [askers.submit(stubbed.get, path) for path in rest]
        refused = next(as_completed(answers)).result()
        assert (refused.status_code, refused.headers["retry-after"]) == (503, "2")
        assert refused.json()["reason"] == "pictures_busy"
        drawn.gate.set()
        assert sorted(answer.result().status_code for answer in answers) == [200, 200, 503]
    assert stubbed.get(refused.url.path).status_code == 200


def test_a_key_that_waits_for_its_share_is_refused_and_another_key_is_not(fresh, drawn, monkeypatch, tmp_path):
    monkeypatch.setattr(on_demand, "MOST_WAITING", 1)
    first, second, third = (f"{FOLDER}/{failure}/picture.png" for failure in ids(fresh)[:3])
    ids_of_keys = iter(("0" * 8, "1" * 8))
    monkeypatch.setattr(secrets, "token_hex", lambda _: next(ids_of_keys))
    file = KeyFile(tmp_path / "keys.json")
    busy, other = ({"authorization": f"Bearer {file.create('default', '', Scope.ADMIN)[1]}"} for _ in range(2))
    with ThreadPoolExecutor(2) as askers:
        answers = [askers.submit(fresh.get, first, headers=busy)]
        wait_for(drawn.begun)
        refused = fresh.get(second, headers=busy)
        assert (refused.status_code, refused.json()["reason"]) == (429, "quota_exceeded")
        assert refused.headers["retry-after"] == "2"
        answers += [askers.submit(fresh.get, third, headers=other)]
        drawn.gate.set()
        assert [answer.result().status_code for answer in answers] == [200, 200]
    assert fresh.get(second, headers=busy).status_code == 200


def test_what_does_not_repeat_can_be_drawn_but_not_played(client, tmp_path):
    for what in ("bundle.npz", "twins/idle.png"):  # each plays it in a process of its own
        answer = client.get(f"{FOLDER}/{RUN}-search-1/{what}")
        assert (answer.status_code, answer.json()["reason"]) == (409, "not_playable")
        assert "/" not in answer.json()["detail"]
    for failure, status, reason in ((f"{RUN}-search-0", 404, "unknown_id"), ("x", 404, "unknown_id")):
        answer = client.get(f"{FOLDER}/{failure}/bundle.npz")
        assert (answer.status_code, answer.json()["reason"]) == (status, reason)
    for twin in ("nobody.png", "nobody", "idle.svg", ".png"):
        assert client.get(f"{FOLDER}/{RUN}-search-1/twins/{twin}").status_code == 422


@pytest.mark.parametrize("what", ["core.npz", "most-plausible.npz", "region"])
def test_what_is_no_valid_failure_is_not_minimised_and_has_no_region_and_is_not_played(client, monkeypatch, what):
    monkeypatch.setattr(on_demand.Helper, "run", lambda *_: pytest.fail("it was played"))
    contacts = client.get(FOLDER, params={"tier": "raw"}).json()["items"]
    invalid = next(each["id"] for each in contacts if each["outcome"] == "degenerate")
    answer = client.get(f"{FOLDER}/{invalid}/{what}")
    assert (answer.status_code, answer.json()["reason"]) == (409, "not_playable")
    assert "is no valid failure" in answer.json()["detail"]


def test_the_picture_and_the_series_of_a_twin_are_of_one_play_and_need_not_be_sent_twice(client, monkeypatch):
    asked = []

    def helper(program, arguments, *, question, **_):
        asked.append(Question.model_validate_json(question))
        with np.load(asked[-1].series) as arrays:
            answer = twin_bytes(TwinPlay.of(None, collision(), []), dict(arrays))
        return HelperResult(status=0, answer=answer, log="")

    monkeypatch.setattr(on_demand, "run_helper", helper)
    failure = f"{FOLDER}/{RUN}-search-2"
    path = f"{failure}/twins/idle"
    told, drawn, again = (client.get(url).raise_for_status() for url in (path, f"{path}.png", path))
    assert drawn.content.startswith(b"\x89PNG")
    assert told.json() == again.json()
    assert (told.json()["twin"], told.json()["outcome"]) == ("idle", "no contact")
    assert told.json()["series"] == client.get(failure).json()["series"]
    assert len(asked) == 1
    for answered in (told, drawn):
        known = {"If-None-Match": answered.headers["etag"]}
        assert client.get(answered.url.path, headers=known).status_code == 304
    client.get(f"{failure}/twins/careful").raise_for_status()
    assert [question.twin and question.twin.profile for question in asked] == [None, "careful"]


def test_the_client_has_the_picture_and_the_series_as_arrays_with_units(client):
    with Client(str(client.base_url)) as remote:
        failure = remote.failure(ENDED_ID, f"{RUN}-search-1")
        assert isinstance(failure.series, Series)
        assert failure.series.ids == ["ego", "lead"]
        assert failure.series.x_m == [[0.0, 1.0], [2.0, None], [4.0, 5.0]]
        assert failure.series.visible == [[None, True], [None, None], [None, False]]
        assert failure.series.released_s == 0.0
        assert json.loads(wire(failure)) == client.get(f"{FOLDER}/{RUN}-search-1").json()
        assert remote.picture(ENDED_ID, failure.id) == client.get(f"{FOLDER}/{RUN}-search-1/picture.png").content
        with pytest.raises(Refused) as refused:
            remote.picture(ENDED_ID, f"{RUN}-search-0")
        assert refused.value.reason == "unknown_id"


@pytest.fixture
def call(client, monkeypatch, capsys):
    """What a command about failures prints, and its exit status."""
    monkeypatch.setenv("RISK_SAC_URL", str(client.base_url))

    def called(*arguments):
        capsys.readouterr()
        status = cli.main(["campaigns", "failures", *map(str, arguments)])
        return status, capsys.readouterr()

    return called


def test_failures_are_listed_in_a_terminal_by_kind_and_grade(call):
    status, printed = call("list", ENDED_ID)
    assert status == 0
    assert max(map(len, printed.out.splitlines())) <= 80
    assert all(word in printed.out for word in (f"{RUN}-search-2", "full_braking", "severe", "leader"))


def test_a_list_of_failures_is_filtered_and_says_that_there_are_more(call, client):
    for flags, query in (
        (["--grade", "full_braking"], {"grade": "full_braking"}),
        (["--fault", "shared", "--severity", "severe"], {"fault": "shared"}),
        (["--kind", "leader"], {"kind": "leader"}),
        (["--broke", "speeding"], {"broke": "speeding"}),
        (["--run", "low-random-3"], {"run": "low-random-3"}),
        (["--raw"], {"tier": "raw"}),
    ):
        _, printed = call("list", ENDED_ID, *flags, "--json")
        assert json.loads(printed.out) == client.get(FOLDER, params=query).json()["items"]
        assert "more" not in printed.err
    status, printed = call("list", ENDED_ID, "--limit", 1)
    assert status == 0
    assert "There are more" in printed.err


def test_a_failure_is_shown_in_words_and_drawn_without_the_folder_of_the_server(call, client, tmp_path):
    file = tmp_path / "new" / "a.png"
    status, printed = call("show", ENDED_ID, f"{RUN}-search-2", "--out", file)
    assert status == 0
    assert file.read_bytes() == client.get(f"{FOLDER}/{RUN}-search-2/picture.png").content
    assert all(word in printed.out for word in (f"{RUN}-search-2: failure", "leader", "full_braking", "'lead'"))
    assert str(file) in printed.err
    _, printed = call("show", ENDED_ID, f"{RUN}-search-2", "--out", file, "--json")
    assert json.loads(printed.out) == client.get(f"{FOLDER}/{RUN}-search-2").json()


def test_a_failure_whose_picture_cannot_be_had_is_exit_status_2(call, tmp_path):
    status, printed = call("show", ENDED_ID, "x", "--out", tmp_path / "a.png")
    assert status == 2
    assert "answered 404" in printed.err
    status, printed = call("show", ENDED_ID, f"{RUN}-search-1", "--out", tmp_path / "a.svg")
    assert status == 2
    assert printed.err.startswith("--out: got ")
    assert not (tmp_path / "a.png").exists()
