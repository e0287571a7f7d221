"""Quotas of a project. Pure functions."""

from service.errors import QuotaError
from service.settings import ServiceSettings
from service.store.stored import Usage

RETRY_S = 60.0
HOUR_S = 3600.0


def check_quota(usage: Usage, new_runs: int, settings: ServiceSettings) -> None:
    """Raises QuotaError if a project has too many queued runs or no worker hours left."""
    if usage.queued_runs + new_runs > settings.quota_queued_runs:
        raise QuotaError(
            f"got {new_runs} runs with {usage.queued_runs} waiting already; wanted at most "
            f"{settings.quota_queued_runs} of one project in the queue",
            RETRY_S,
        )
    if exhausted(usage, settings):
        raise QuotaError(
            f"the project has used {usage.cpu_s / HOUR_S:.2f} worker hours within 24; wanted at most "
            f"{settings.quota_cpu_hours:g}",
            HOUR_S,
        )


def exhausted(usage: Usage, settings: ServiceSettings) -> bool:
    """Returns whether a project's worker hours are used up, so that its runs wait."""
    return settings.quota_cpu_hours is not None and usage.cpu_s >= settings.quota_cpu_hours * HOUR_S
