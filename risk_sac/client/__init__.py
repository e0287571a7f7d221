"""HTTP client of the service, without the method and the simulator.

from risk_sac.client import Client

with Client("http://127.0.0.1:8000") as client:
    campaign = client.submit({"families": ["low"], "methods": ["risk-sac", "random"], "budget": {"episodes": 40}})
    client.wait(campaign.id)
    for total in client.results(campaign.id).totals:
        ...
    for found in client.failures(campaign.id):
        series = client.failure(campaign.id, found.id).series  # arrays, a row per step: series.speed_mps, series.ttc_s
        Path(f"{found.id}.png").write_bytes(client.picture(campaign.id, found.id))
"""

from risk_sac.client.client import Client
from risk_sac.client.transport import ClientError, Event, Overdue, Refused, StreamLost, UnexpectedAnswer, Unreachable
from risk_sac.records import (
    Campaign,
    CampaignSummary,
    Collision,
    Episode,
    Failure,
    FieldProblem,
    Judgement,
    Progress,
    Results,
    Run,
    RunMetrics,
    RunResult,
    Total,
)
from risk_sac.world.types import Series

__all__ = [
    "Campaign",
    "CampaignSummary",
    "Client",
    "ClientError",
    "Collision",
    "Episode",
    "Event",
    "Failure",
    "FieldProblem",
    "Judgement",
    "Overdue",
    "Progress",
    "Refused",
    "Results",
    "Run",
    "RunMetrics",
    "RunResult",
    "Series",
    "StreamLost",
    "Total",
    "UnexpectedAnswer",
    "Unreachable",
]
