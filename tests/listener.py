"""Listens to a run in this process."""

from dataclasses import dataclass, field

from risk_sac.records import EpisodeRecord, RunMetrics, SeriesFile


@dataclass
class Listener:
    """Observer that keeps every record and stops the run after `limit`."""

    limit: int = 10**9
    records: list[EpisodeRecord] = field(default_factory=list)
    series: list[SeriesFile | None] = field(default_factory=list)

    def episode(self, record: EpisodeRecord, metrics: RunMetrics, series: SeriesFile | None) -> None:
        self.records.append(record)
        self.series.append(series)

    def should_stop(self) -> bool:
        return len(self.records) >= self.limit
