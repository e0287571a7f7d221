"""The picture of a contact over REST: a real server with known campaigns."""

import struct
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import httpx
import pytest

from risk_sac.run_folder.results import FAILURES, series_name
from service.settings import ServiceSettings
from service.store.database import READERS
from service.views import pictures
from tests.contract.recorded_campaigns import ENDED_ID, Recorded, known_times_and_ids
from tests.contract.serving import serving

RUN = "low-risk-sac-3"
FOLDER = f"/v1/campaigns/{ENDED_ID}/failures"


@pytest.fixture
def settings(tmp_path) -> ServiceSettings:
    return ServiceSettings(data_dir=tmp_path, max_workers=1)


@pytest.fixture
def client(settings) -> Iterator[httpx.Client]:
    with known_times_and_ids() as clock:
        Recorded(settings, clock).write()
        with serving(settings) as url, httpx.Client(base_url=url, timeout=120) as client:
            yield client


@pytest.fixture
def drawn(monkeypatch):
    """The pictures that are drawn, each as soon as its gate is open."""
    draw, begun, gate = pictures.recording_bytes, [], threading.Event()

    def drawing(family, recording, format_):
        begun.append(recording.contact.id)
        assert gate.wait(60)
        return draw(family, recording, format_)

    monkeypatch.setattr(pictures, "recording_bytes", drawing)
    drawing.begun, drawing.gate = begun, gate
    yield drawing
    gate.set()


def ids(client) -> list[str]:
    """Of all contacts, valid or not."""
    return [each["id"] for each in client.get(FOLDER, params={"tier": "raw"}).json()["items"]]


def test_every_contact_has_a_picture_that_need_not_be_sent_twice(client):
    for failure in ids(client):
        answer = client.get(f"{FOLDER}/{failure}/picture.png")
        assert (answer.status_code, answer.headers["content-type"]) == (200, "image/png")
        assert answer.headers["cache-control"] == "no-cache"
        assert answer.content.startswith(b"\x89PNG")
        assert min(struct.unpack(">II", answer.content[16:24])) >= 600
        known = {"If-None-Match": answer.headers["etag"]}
        assert client.get(f"{FOLDER}/{failure}/picture.png", headers=known).status_code == 304


def test_pictures_of_two_contacts_have_two_tags(client):
    tags = {client.get(f"{FOLDER}/{failure}/picture.png").headers["etag"] for failure in ids(client)[:2]}
    assert len(tags) == 2


def test_what_is_no_contact_has_no_picture(client):
    for path in (f"{FOLDER}/{RUN}-train-0", f"{FOLDER}/x", f"/v1/campaigns/c0/failures/{RUN}-train-1"):
        answer = client.get(f"{path}/picture.png")
        assert (answer.status_code, answer.json()["reason"]) == (404, "unknown_id")


def test_a_contact_whose_series_is_lost_or_damaged_has_no_picture_and_says_so(client, settings):
    file = settings.run_folder(ENDED_ID, RUN) / FAILURES / series_name(1)
    content = file.read_bytes()
    for breaking, why in ((lambda: file.write_bytes(content[:-1]), "is damaged"), (file.unlink, "is gone")):
        breaking()
        answer = client.get(f"{FOLDER}/{RUN}-train-1/picture.png")
        assert (answer.status_code, answer.json()["reason"]) == (404, "series_lost")
        assert why in answer.json()["detail"]
        assert str(settings.data_dir) not in answer.text
    file.write_bytes(content)
    assert client.get(f"{FOLDER}/{RUN}-train-1/picture.png").status_code == 200


def test_a_picture_is_drawn_once_for_all_who_ask_for_it_and_holds_up_nothing_else(client, drawn):
    path = f"{FOLDER}/{ids(client)[0]}/picture.png"
    with ThreadPoolExecutor(READERS + 5) as askers:
        answers = [askers.submit(client.get, path) for _ in range(READERS + 5)]
        while not drawn.begun:
            pass
        assert client.get("/healthz").status_code == 200
        assert client.get(FOLDER).status_code == 200  # in one of the threads that read the database
        assert not any(answer.done() for answer in answers)
        drawn.gate.set()
        assert len({answer.result().content for answer in answers}) == 1
    assert len(drawn.begun) == 1
    client.get(path)
    assert len(drawn.begun) == 1


def test_no_more_than_a_bounded_number_waits_and_others_are_told_when_to_come_back(client, drawn, monkeypatch):
    monkeypatch.setattr(pictures, "MOST_WAITING", 1)
    first, second, third, *_ = (f"{FOLDER}/{failure}/picture.png" for failure in ids(client))
    with ThreadPoolExecutor(2) as askers:
        served = [askers.submit(client.get, path) for path in (first, second)]
        while (refused := client.get(third)).status_code != 503:
            pass
        assert (refused.json()["reason"], refused.headers["retry-after"]) == ("pictures_busy", "2")
        drawn.gate.set()
        assert [answer.result().status_code for answer in served] == [200, 200]
    assert client.get(third).status_code == 200
