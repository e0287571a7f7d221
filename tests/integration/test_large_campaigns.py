"""Views of large campaigns: made by a helper, equal to the server's."""

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import closing, suppress
from pathlib import Path
from typing import Any

import httpx
import psutil
import pytest

from risk_sac.records import Outcome
from service.settings import ServiceSettings
from service.store.reading import Store
from service.views.reports import Reports
from service.views.whole import LARGE, MEMORY_BYTES, CampaignView, Content, Sources, content_of
from tests.load.large import enlarge
from tests.server import Service

PLAYED = 16
LOOK_S = 0.02
PROGRAM = "service.views.whole"


@pytest.fixture(scope="module")
def service(serve_shared: Callable[..., Service]) -> Service:
    """A service with one campaign, which is just large."""
    service = serve_shared("risk_sac.execution.worker")
    service.wait(service.post(methods=["archive"], budget={"episodes": PLAYED}))
    service.stop()
    enlarge(service.data_dir, LARGE // PLAYED + 1)
    service.start()
    return service


@pytest.fixture(scope="module")
def campaign(service: Service) -> str:
    (campaign,) = service.client.get("/v1/campaigns").json()["items"]
    return str(campaign["id"])


@pytest.fixture
def here(service: Service, campaign: str) -> Iterator[Callable[..., Content]]:
    """Makes a view in the process of the test."""
    settings = ServiceSettings(data_dir=service.data_dir)
    with closing(Store(settings.url, opened=True)) as store:
        sources = Sources(settings, store, Reports(settings), store.campaign(campaign))
        yield lambda **fields: content_of(CampaignView(campaign_id=campaign, edition="", **fields), sources)


def asked(service: Service, method: str, path: str, **options: Any) -> tuple[httpx.Response, set[tuple[int, int]]]:
    """Returns an answer and the memory limits of its helper processes."""
    server, limits = psutil.Process(service.process.pid), set()
    with ThreadPoolExecutor(1) as pool:
        answer = pool.submit(service.client.request, method, path, **options)
        while not answer.done():
            for child in server.children(recursive=True):
                with suppress(psutil.Error):
                    if PROGRAM in child.cmdline():
                        limits.add(child.rlimit(psutil.RLIMIT_AS))
            wait([answer], LOOK_S)
    return answer.result(), limits


@pytest.mark.parametrize(
    ("path", "fields"),
    [
        ("/failure-table", {"name": "failure_table", "outcomes": (Outcome.FAILURE,)}),
        ("/table?format=csv", {"name": "table", "format": "csv", "address": "{base}"}),
        pytest.param("/scenes", {"name": "scenes"}, marks=pytest.mark.torture),
        pytest.param(
            "/report?format=md", {"name": "report", "format": "md", "address": "{base}"}, marks=pytest.mark.torture
        ),
    ],
)
def test_a_view_of_a_large_campaign_is_made_in_a_bounded_helper_process(service, campaign, here, path, fields):
    answer, limits = asked(service, "GET", f"/v1/campaigns/{campaign}{path}")
    assert answer.status_code == 200, answer.text
    assert (MEMORY_BYTES, MEMORY_BYTES) in limits
    fields = {name: f"{service.client.base_url}/" if value == "{base}" else value for name, value in fields.items()}
    assert answer.content == here(**fields).body


def test_all_figures_of_a_large_campaign_are_drawn_at_once(service, campaign):
    (first, *others) = (each["name"] for each in service.get(campaign, "/figures")["items"])
    drawn, limits = asked(service, "GET", f"/v1/campaigns/{campaign}/figures/{first}.svg")
    assert drawn.status_code == 200, drawn.text
    assert limits
    for name, status in ((others[-1], 200), ("nothing", 404)):
        answer, limits = asked(service, "GET", f"/v1/campaigns/{campaign}/figures/{name}.svg")
        assert (answer.status_code, limits) == (status, set())


def test_a_check_reads_an_earlier_campaign_once_and_writes_nothing(service, campaign):
    body = {"families": ["low"], "methods": ["archive"], "prior": campaign}
    places = service.data_dir / "places"
    before = files(places)
    first, limits = asked(service, "POST", "/v1/campaigns/check", json=body)
    assert first.status_code == 200, first.text
    assert (MEMORY_BYTES, MEMORY_BYTES) in limits
    again, limits = asked(service, "POST", "/v1/campaigns/check", json=body)
    other, _ = asked(service, "POST", "/v1/campaigns/check", json=body | {"families": ["mixed"]})
    assert (again.status_code, other.status_code, limits) == (200, 422, set())
    assert files(places) == before
    posted = service.client.post("/v1/campaigns", json=body | {"budget": {"episodes": 1}}).raise_for_status().json()
    (copy,) = (places / "priors").glob("*.json")
    assert posted["spec"]["prior"] == copy.stem
    before = files(places)
    assert service.client.post("/v1/campaigns/check", json=body | {"prior": copy.stem}).status_code == 200
    assert files(places) == before


def files(folder: Path) -> dict[str, int]:
    return {str(file): file.stat().st_mtime_ns for file in folder.rglob("*")}
