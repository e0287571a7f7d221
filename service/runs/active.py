"""What the manager knows of a run at work."""

from dataclasses import dataclass

from service.store.stored import StoredRun
from service.workers.messages import Failed, Finished


@dataclass(slots=True)
class Active:
    """A run whose worker lives."""

    run: StoredRun
    project: str
    cancelled: bool = False
    abandoned: bool = False  # the disk refused; what it still says is not wanted, since it will be said again
    last: Finished | Failed | None = None

    @property
    def ids(self) -> dict[str, str]:
        """What a line of the log says it is about."""
        return {"campaign": self.run.campaign_id, "run": self.run.id}
