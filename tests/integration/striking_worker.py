"""The scripted worker, but in every second episode the ego fails."""

from dataclasses import replace

import scripted_worker

from risk_sac.types import EpisodeRecord, Outcome, RunMetrics

_record, _metrics = scripted_worker.record, scripted_worker.metrics


def record(index: int) -> EpisodeRecord:
    return replace(_record(index), outcome=Outcome.FAILURE if index % 2 else Outcome.SAFE)


def metrics(episodes: int) -> RunMetrics:
    failures = episodes // 2
    return replace(_metrics(episodes), failures=failures, raw_collisions=failures, ecr=failures / episodes)


if __name__ == "__main__":
    scripted_worker.record, scripted_worker.metrics = record, metrics
    scripted_worker.main()
