"""Bodies of the responses."""

from risk_sac.metrics import Funnel
from service.schemas.base import Body, Real
from service.schemas.campaign_results import Results, RunResult, Total
from service.schemas.campaigns import Campaign, CampaignPage, CampaignSummary, Metrics, Progress, Run
from service.schemas.catalogue import Families, Family, Methods, NamedMethod, SceneParameter, Signal
from service.schemas.changes import StateChange
from service.schemas.episodes import Collision, Episode, EpisodePage, Judgement, ReferenceOutcome
from service.schemas.failures import Failure, Series
from service.schemas.health import Health, Ready
from service.schemas.problems import FieldProblem, Problem, Reason

__all__ = [
    "Body",
    "Campaign",
    "CampaignPage",
    "CampaignSummary",
    "Collision",
    "Episode",
    "EpisodePage",
    "Failure",
    "Families",
    "Family",
    "FieldProblem",
    "Funnel",
    "Health",
    "Judgement",
    "Methods",
    "Metrics",
    "NamedMethod",
    "Problem",
    "Progress",
    "Ready",
    "Real",
    "Reason",
    "ReferenceOutcome",
    "Results",
    "Run",
    "RunResult",
    "SceneParameter",
    "Series",
    "Signal",
    "StateChange",
    "Total",
]
