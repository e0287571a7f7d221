"""What answers at `/`."""

from typing import Literal

from service.schemas.base import Body


class Entrance(Body):
    """Where what is, as paths of this service."""

    name: Literal["RISK-SAC"] = "RISK-SAC"
    version: str
    docs: Literal["/docs"] = "/docs"
    """A page for people, which tells of all routes and calls them."""
    openapi: Literal["/openapi.json"] = "/openapi.json"
    """The same for programs."""
    health: Literal["/healthz"] = "/healthz"
    campaigns: Literal["/v1/campaigns"] = "/v1/campaigns"
