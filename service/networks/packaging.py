"""How an upload is packed: what its Content-Type says, and what its first bytes must be."""

from enum import StrEnum

from service.errors import UploadError


class Packaging(StrEnum):
    """What the body of an upload is."""

    XML = "xml"
    GZIP = "gzip"
    ZIP = "zip"


MEDIA_TYPES = {
    "application/xml": Packaging.XML,
    "text/xml": Packaging.XML,
    "application/gzip": Packaging.GZIP,
    "application/x-gzip": Packaging.GZIP,
    "application/zip": Packaging.ZIP,
}
SNIFFED_BYTES = 64
_STARTS = {Packaging.XML: b"<", Packaging.GZIP: b"\x1f\x8b", Packaging.ZIP: b"PK\x03\x04"}
_BYTE_ORDER_MARK = b"\xef\xbb\xbf"


def sniff(start: bytes, packaging: Packaging) -> None:
    """Refuse at once what cannot be what it is called, so that no process is started for it.

    Args:
      start: the first SNIFFED_BYTES of the upload.
      packaging: what its Content-Type says.

    Raises:
      UploadError: it is empty, or something else.
    """
    if not start:
        raise UploadError("the upload is empty; wanted a network")
    text = start.removeprefix(_BYTE_ORDER_MARK).lstrip() if packaging is Packaging.XML else start
    if not text.startswith(_STARTS[packaging]):
        raise UploadError(f"the upload starts with {start[:8]!r}, which is no {packaging}; wanted what its type says")
