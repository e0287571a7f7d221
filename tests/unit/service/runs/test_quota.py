import pytest

from service.errors import QuotaError
from service.runs.quota import check_quota, exhausted
from service.settings import ServiceSettings
from service.store.stored import Usage

SETTINGS = ServiceSettings(quota_queued_runs=10, quota_cpu_hours=2.0)


def usage(queued_runs: int = 0, hours: float = 0.0) -> Usage:
    return Usage(queued_runs=queued_runs, cpu_s=3600.0 * hours)


@pytest.mark.parametrize(("waiting", "new"), [(0, 11), (9, 2), (10, 1)])
def test_one_run_more_is_refused_with_the_figures(waiting: int, new: int) -> None:
    with pytest.raises(
        QuotaError, match=f"got {new} runs with {waiting} waiting already; wanted at most 10"
    ) as refusal:
        check_quota(usage(waiting), new, SETTINGS)
    assert refusal.value.retry_after_s > 0


def test_worker_hours_are_used_up_when_they_are_reached() -> None:
    check_quota(usage(hours=1.999), 1, SETTINGS)
    assert not exhausted(usage(hours=1.999), SETTINGS)
    assert exhausted(usage(hours=2.0), SETTINGS)
    with pytest.raises(QuotaError, match=r"has used 2.00 worker hours within 24; wanted at most 2") as refusal:
        check_quota(usage(hours=2.0), 1, SETTINGS)
    assert refusal.value.retry_after_s > 0
