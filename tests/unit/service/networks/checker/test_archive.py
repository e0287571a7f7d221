import contextlib
import gzip
import random
from pathlib import Path

import pytest

from service.errors import UploadError
from service.networks.checker import archive
from service.networks.checker.archive import documents
from service.networks.report import Packaging, sniff
from tests.hostile_networks import ADDITIONAL, NET, ROUTES, zipped

PACKED = {
    Packaging.XML: NET.encode(),
    Packaging.GZIP: gzip.compress(NET.encode()),
    Packaging.ZIP: zipped(NET, ROUTES, "", names=("nets/a.net.xml", "b.rou.xml", "nets/")),
}


@pytest.fixture
def upload(tmp_path: Path) -> Path:
    return tmp_path / "upload"


@pytest.mark.parametrize("packaging", Packaging)
def test_documents_come_out_as_they_went_in(upload: Path, packaging: Packaging) -> None:
    upload.write_bytes(PACKED[packaging])
    sniff(PACKED[packaging], packaging)
    files = [NET.encode(), ROUTES.encode()]
    assert documents(upload, packaging) == files[: 2 if packaging is Packaging.ZIP else 1]


@pytest.mark.parametrize("packaging", [Packaging.GZIP, Packaging.ZIP])
def test_damage_of_any_kind_is_refused_and_nothing_else_happens(upload: Path, packaging: Packaging) -> None:
    generator = random.Random(4)
    refused = 0
    for _ in range(300):
        content = bytearray(PACKED[packaging])
        for _ in range(generator.randint(1, 4)):
            content[generator.randrange(len(content))] = generator.randrange(256)
        if generator.random() < 0.2:
            del content[generator.randrange(len(content)) :]
        upload.write_bytes(content)
        with contextlib.suppress(UploadError):
            documents(upload, packaging)
            refused -= 1
        refused += 1
    assert refused > 250


def test_all_files_of_an_archive_count_together(upload: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(archive, "MAX_EXPANDED_BYTES", 2 * len(NET))
    upload.write_bytes(zipped(NET, NET))
    assert len(documents(upload, Packaging.ZIP)) == 2
    upload.write_bytes(zipped(NET, NET, ADDITIONAL))
    with pytest.raises(UploadError, match="once unpacked"):
        documents(upload, Packaging.ZIP)


def test_packing_is_stopped_at_the_ratio_and_not_at_its_end(upload: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(archive, "MAX_EXPANDED_BYTES", 1 << 40)
    upload.write_bytes(gzip.compress(bytes(50 << 20)))
    with pytest.raises(UploadError, match="more than 100 times"):
        documents(upload, Packaging.GZIP)
