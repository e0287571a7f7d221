"""Liveness, readiness and metrics for operators."""

from http import HTTPStatus
from typing import Literal

from fastapi import APIRouter, Depends, Response
from prometheus_client import CONTENT_TYPE_LATEST, generate_latest

from risk_sac.records import Record
from service.api.context import Service, require_admin
from service.api.pages import STOPPED, UNREADY, Responses
from service.api.problems import ProblemError, Reason
from service.store.counting import check_readable


class Health(Record):
    """The server is alive."""

    status: Literal["ok"] = "ok"


class Ready(Record):
    """Campaigns can be posted and make progress."""

    status: Literal["ready"] = "ready"


EXAMPLE = 'risk_sac_episodes_total{family="low",method="risk-sac"} 4711.0\n…'
METRICS: Responses = {200: {"content": {"text/plain": {"schema": {"type": "string"}, "example": EXAMPLE}}}}

router = APIRouter()


@router.get("/healthz", tags=["operations"], responses=STOPPED)
async def get_health(service: Service) -> Health:
    """Liveness: restart the service if this fails."""
    if not service.manager.alive:
        detail = "the manager has stopped; the log has the reason"
        raise ProblemError(HTTPStatus.SERVICE_UNAVAILABLE, Reason.MANAGER_STOPPED, detail)
    return Health()


@router.get("/readyz", tags=["operations"], responses=UNREADY)
def get_readiness(service: Service) -> Ready:
    """Readiness: whether campaigns can be posted and progress; recovers once the cause is gone."""
    problem = service.manager.storage_problem
    if problem is not None:
        raise ProblemError(HTTPStatus.SERVICE_UNAVAILABLE, Reason.STORAGE_UNAVAILABLE, problem)
    check_readable(service.store.engine)
    return Ready()


# A key that may see all campaigns: the runs at work are among the metrics.
@router.get(
    "/metrics",
    tags=["operations"],
    response_class=Response,
    responses=METRICS,
    dependencies=[Depends(require_admin)],
)
def get_metrics(service: Service) -> Response:
    """Metrics in the text format of Prometheus."""
    return Response(generate_latest(service.metrics), media_type=CONTENT_TYPE_LATEST)
