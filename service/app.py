"""The FastAPI application."""

import os
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, closing, contextmanager

from anyio import to_thread
from fastapi import FastAPI
from prometheus_client import Histogram

from risk_sac import __version__
from risk_sac.execution import executor_named
from risk_sac.execution.executor import Executor
from risk_sac.scenario.library import VARIABLE
from service.api.context import Context
from service.api.description import DESCRIPTION, openapi
from service.api.metrics import registry, request_latencies
from service.api.middleware import add_middleware
from service.api.pages import Cursors
from service.api.problems import add_problem_handlers
from service.api.routes import campaigns, catalogue, episodes, events, exports, networks, reports, scenarios, server
from service.api.stream import Streams
from service.host import hold_data_folder
from service.keys import check_exposure
from service.networks.network_store import NetworkStore
from service.networks.scenarios import Scenarios
from service.networks.surveys import Surveys
from service.runs.manager import Manager, worker_program
from service.runs.regressions import Regressions
from service.settings import ServiceSettings
from service.store.database import READERS, cursor_secret, held
from service.store.reading import Store
from service.views.on_demand import KEPT, Helper, OnDemandCache
from service.views.reports import Reports
from service.views.series import EpisodeTables, Studies
from service.views.series import pictures as pictures_of_failures
from service.views.whole import VIEWS_KEPT, Priors, Views


def create_app(settings: ServiceSettings, executor: Executor | None = None) -> FastAPI:
    """Makes the ASGI application; uses disk and processes only once started.

    Args:
      settings: the environment's settings.
      executor: where runs execute; by default as the settings say.
    """
    latencies = request_latencies()

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        to_thread.current_default_thread_limiter().total_tokens = READERS
        with (
            closing(executor or executor_named(settings.executor)(worker_program(settings))) as chosen,
            opened(settings, chosen, latencies) as context,
        ):
            app.state.context = context
            yield

    app = FastAPI(
        title="RISK-SAC",
        description=DESCRIPTION,
        version=__version__,
        lifespan=lifespan,
        redirect_slashes=False,
        generate_unique_id_function=lambda route: route.name,
        openapi_url=None,  # the routes have all of these, packed once, and pages that need no network
        docs_url=None,
        redoc_url=None,
    )
    of_campaigns = [routes.router for routes in (campaigns, episodes, exports, events, reports)]
    others = [routes.router for routes in (networks, scenarios, catalogue, server)]
    for router in (*of_campaigns, reports.coverage_router, reports.regressions_router, *others):
        app.include_router(router)
    app.router.routes += server.page_routes()
    add_problem_handlers(app)
    add_middleware(app, settings, latencies)
    app.openapi = lambda: openapi(app)  # type: ignore[method-assign]  # FastAPI's documented way
    return app


@contextmanager
def opened(settings: ServiceSettings, executor: Executor, latencies: Histogram) -> Iterator[Context]:
    """Holds the data folder exclusively, opens its database and runs its queue.

    Raises:
      StorageError: the data folder is in use, or cannot be written.
      ConfigError: other machines could call, and no API key exists.
      KeysError: the API keys cannot be read.
    """
    check_exposure(settings)
    with hold_data_folder(settings.data_dir), closing(Store(settings.url)) as store, held(store.engine):
        # Everything that plays or draws an episode, here or in a helper process, finds its place in our library.
        os.environ[VARIABLE] = str(settings.places_dir.absolute())
        manager = Manager(settings, store, executor)
        regression_queue, helper = Regressions(settings), Helper(settings)
        reports = Reports(settings)
        views, priors = (Views(settings, store, reports, helper, most) for most in (VIEWS_KEPT, KEPT))
        uploaded = NetworkStore(settings.networks_dir)
        surveys = Surveys(uploaded, settings.places_dir, helper.stopping)
        kept = Scenarios(settings.scenarios_dir, settings.places_dir, helper.stopping)
        manager.start()
        try:
            regression_queue.start()
            yield Context(
                settings=settings,
                store=store,
                manager=manager,
                reports=reports,
                pictures=pictures_of_failures(settings),
                studies=Studies(settings, helper),
                tables=EpisodeTables(helper),
                views=views,
                priors=Priors(store, priors),
                regressions=regression_queue,
                networks=uploaded,
                surveys=surveys,
                scenarios=kept,
                scenario_pictures=OnDemandCache(kept.picture, "pictures of scenarios", at_once=2),
                streams=Streams(store),
                cursors=Cursors(cursor_secret(store.engine)),
                metrics=registry(latencies, store, manager),
            )
        finally:
            helper.stop()
            surveys.stop()
            regression_queue.stop()
            manager.stop()
