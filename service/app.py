"""The FastAPI application."""

from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager
from typing import IO, Any

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi

from risk_sac import __version__
from service.api import campaigns, catalogue, reports
from service.api.body import body_schemas
from service.api.context import Context
from service.api.problems import add_problem_handlers
from service.errors import StorageError
from service.executor import Executor, LocalExecutor
from service.locks import try_lock
from service.manager import Manager
from service.reports import Reports
from service.settings import ServiceSettings
from service.store import Store

DESCRIPTION = """Finds scenarios in which an automated driving system fails.

Post a campaign, follow it, read what it found. All errors are problem details (RFC 9457) that name the field."""


def create_app(settings: ServiceSettings, executor: Executor | None = None) -> FastAPI:
    """The service as an ASGI application; it touches neither disk nor processes until it is started.

    Args:
      settings: the environment's settings.
      executor: where runs execute; by default processes of this machine.
    """

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        with opened(settings, executor or LocalExecutor(settings.worker_module, settings.grace_s)) as context:
            app.state.context = context
            yield

    app = FastAPI(
        title="RISK-SAC", description=DESCRIPTION, version=__version__, lifespan=lifespan, redirect_slashes=False
    )
    app.include_router(campaigns.router)
    app.include_router(reports.router)
    app.include_router(catalogue.router)
    add_problem_handlers(app)
    app.openapi = lambda: openapi(app)  # type: ignore[method-assign]  # FastAPI's documented way
    return app


@contextmanager
def opened(settings: ServiceSettings, executor: Executor) -> Iterator[Context]:
    """The data folder, held exclusively, with its database open and its queue at work.

    Raises:
      StorageError: the data folder is in use, or cannot be written.
    """
    with _data_folder(settings):
        store = Store(settings.database)
        manager = Manager(settings, store, executor)
        manager.start()
        try:
            yield Context(settings, store, manager, Reports(settings))
        finally:
            manager.stop()
            store.close()


def openapi(app: FastAPI) -> dict[str, Any]:
    """The app's OpenAPI document, with every error response declared as a problem."""
    if app.openapi_schema is not None:
        return app.openapi_schema
    document = get_openapi(title=app.title, version=app.version, description=app.description, routes=app.routes)
    document["components"]["schemas"] |= body_schemas()
    for operations in document["paths"].values():
        for operation in operations.values():
            for status, response in operation["responses"].items():
                if int(status) >= 400:
                    response["content"] = {"application/problem+json": response["content"]["application/json"]}
    app.openapi_schema = document
    return document


def _data_folder(settings: ServiceSettings) -> IO[bytes]:
    try:
        settings.data_dir.mkdir(parents=True, exist_ok=True)
        return try_lock(settings.data_dir)
    except OSError as error:
        message = f"data_dir is {str(settings.data_dir)!r}; wanted a folder that can be written ({error.strerror})"
        raise StorageError(message) from error
