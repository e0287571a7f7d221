"""Harmful uploads are refused in time with a reason, leaving nothing behind."""

import re
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.hostile_networks import NET, uploads
from tests.server import Service

TIME_S = 10
DATABASE = ("risk-sac.db", "risk-sac.db-wal", "risk-sac.db-shm")


@pytest.fixture
def service(serve: Callable[..., Service], tmp_path: Path) -> Service:
    """A server that would leave its temporary files where we see them."""
    for name in ("tmp", "home"):
        (tmp_path / name).mkdir()
    return serve(environment={"TMPDIR": str(tmp_path / "tmp"), "HOME": str(tmp_path / "home")})


def listed(folder: Path) -> dict[str, int]:
    """Returns a folder's content with sizes, without the server's changing files."""
    paths = [path for path in folder.rglob("*") if path.name not in DATABASE and path.suffix != ".log"]
    return {str(path.relative_to(folder)): path.stat().st_size if path.is_file() else -1 for path in paths}


def spread(items: list, count: int) -> list:
    """So many of the items, from all over the list."""
    return items[:: max(1, len(items) // count)]


@pytest.mark.timeout(1800)
def test_hostile_uploads_are_refused_in_time_and_leave_nothing(service, times, tell, tmp_path):
    every = uploads()
    chosen = spread(every, times(18, len(every)))
    assert len(chosen) >= 18
    headers = {"content-type": "application/xml"}
    kept = service.client.post("/v1/networks", content=NET, headers=headers, params={"label": "kept"})
    assert kept.status_code == 201, kept.text
    before = listed(tmp_path)
    took = []
    for hostile in chosen:
        body = hostile.make()
        began = time.monotonic()
        response = service.client.post("/v1/networks", content=body, headers={"content-type": hostile.content_type})
        took.append((time.monotonic() - began, hostile.name))
        assert response.status_code == hostile.status, f"{hostile.name}: {response.text[:500]}"
        assert response.headers["content-type"] == "application/problem+json"
        assert re.search(hostile.says, response.json()["detail"]), f"{hostile.name}: {response.json()['detail']}"
        assert took[-1][0] <= TIME_S, hostile.name
        assert listed(tmp_path) == before, hostile.name
    assert not list(Path("/tmp").glob("evil*"))
    assert service.client.get("/healthz").status_code == 200
    assert service.client.get("/v1/networks").json()["items"] == [kept.json()]
    assert service.client.post("/v1/networks", content=NET, headers=headers).status_code == 200
    assert "Traceback" not in service.log.read_text()
    slowest = ", ".join(f"{name} {seconds:.1f} s" for seconds, name in sorted(took)[:-4:-1])
    tell(f"{len(took)} hostile uploads refused; slowest: {slowest}")
