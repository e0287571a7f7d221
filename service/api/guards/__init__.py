"""What stands before all routes: pure ASGI, since each request pays for it and streams must pass."""

from fastapi import FastAPI

from service.api.guards.body import BodyLimit
from service.api.guards.cors import Cors
from service.api.guards.gate import Gate
from service.api.guards.headers import SecurityHeaders
from service.keys.made import KeysMade
from service.settings import ServiceSettings


def add_guards(app: FastAPI, settings: ServiceSettings, made: KeysMade) -> None:
    """Puts the guards in place; the one added last is the first to see a request."""
    app.add_middleware(BodyLimit, settings=settings)
    app.add_middleware(Gate, settings=settings, made=made)
    if settings.cors_origins:
        app.add_middleware(Cors, origins=settings.cors_origins)
    app.add_middleware(SecurityHeaders)
