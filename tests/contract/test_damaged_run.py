"""A run whose files are damaged: which one it is and what still works is told."""

import httpx
import pytest

from risk_sac.run_folder.results import EPISODES, RESULTS
from service.settings import ServiceSettings
from tests.contract.recorded_campaigns import ENDED_ID, Recorded, known_times_and_ids
from tests.contract.serving import serving

RUN = "low-risk-sac-3"


def flip(content: bytes) -> bytes:
    middle = len(content) // 2
    return content[:middle] + bytes([content[middle] ^ 0x80]) + content[middle + 1 :]


def shorten(content: bytes) -> bytes:
    """Whole lines of it."""
    return b"".join(content.splitlines(keepends=True)[:-1])


@pytest.mark.parametrize(
    ("name", "damage"), [(RESULTS, flip), (RESULTS, shorten), (EPISODES, flip), (EPISODES, shorten)]
)
def test_a_table_that_cannot_be_made_names_the_damaged_file_and_what_still_works(tmp_path, name, damage):
    settings = ServiceSettings(data_dir=tmp_path, max_workers=1)
    with known_times_and_ids() as clock:
        Recorded(settings, clock).write()
    file = settings.run_folder(ENDED_ID, RUN) / name
    file.write_bytes(damage(file.read_bytes()))
    with serving(settings) as url, httpx.Client(base_url=f"{url}/v1/campaigns/{ENDED_ID}", timeout=600) as client:
        refused = client.get("/export", params={"format": "parquet"})
        assert (refused.status_code, refused.json()["reason"]) == (503, "storage_unavailable")
        assert f"run {RUN}: {name} " in refused.json()["detail"]
        assert "`episodes` of the campaign still lists them all" in refused.json()["detail"]
        assert str(tmp_path) not in refused.text
        assert len(client.get("/episodes").json()["items"]) == 13
