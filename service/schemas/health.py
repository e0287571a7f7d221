"""Whether the service works."""

from typing import Literal

from service.schemas.base import Body


class Health(Body):
    """The server is alive."""

    status: Literal["ok"] = "ok"


class Ready(Body):
    """Campaigns can be posted and make progress."""

    status: Literal["ready"] = "ready"
