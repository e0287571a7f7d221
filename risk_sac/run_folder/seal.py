"""JSON that tells when it was damaged: its last field is the SHA-256 of all bytes before it."""

import hashlib
import re

from risk_sac.errors import DamagedError

_SEAL = re.compile(rb',\n  "sha256": "([0-9a-f]{64})"\n}\n\Z')
_END = b"\n}"


def seal(text: bytes) -> bytes:
    """A JSON object, indented by 2 and not empty, with the field `sha256` added."""
    if not text.endswith(_END):
        raise ValueError(f"the text ends in {text[-10:]!r}; wanted a JSON object that ends in {_END!r}")
    return text.removesuffix(_END) + f',\n  "sha256": "{hashlib.sha256(text).hexdigest()}"\n}}\n'.encode()


def unseal(content: bytes) -> bytes:
    """The text that was sealed.

    Content without a seal comes back as it is. Its reader accepts no field that it does not know, so a seal that was
    damaged itself is noticed there.

    Raises:
      DamagedError: the seal is not that of the text.
    """
    found = _SEAL.search(content)
    if found is None:
        return content
    text = content[: found.start()] + _END
    actual, wanted = hashlib.sha256(text).hexdigest(), found[1].decode()
    if actual != wanted:
        raise DamagedError(f"its SHA-256 is {actual}, wanted {wanted}")
    return text
