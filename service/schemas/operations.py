"""What answers at `/`, `/healthz` and `/readyz`."""

from typing import Literal

from risk_sac.records import Record


class Entrance(Record):
    """Paths of this service."""

    name: Literal["RISK-SAC"] = "RISK-SAC"
    version: str
    docs: Literal["/docs"] = "/docs"
    """A page that describes and calls all routes."""
    openapi: Literal["/openapi.json"] = "/openapi.json"
    """The same for programs."""
    health: Literal["/healthz"] = "/healthz"
    campaigns: Literal["/v1/campaigns"] = "/v1/campaigns"


class Health(Record):
    """The server is alive."""

    status: Literal["ok"] = "ok"


class Ready(Record):
    """Campaigns can be posted and make progress."""

    status: Literal["ready"] = "ready"
