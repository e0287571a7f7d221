"""Ended campaigns of an ego's versions, to compare."""

from collections.abc import Mapping, Sequence
from typing import Any

from risk_sac.config import CampaignSpec
from risk_sac.records import RequirementCounts, RunMetrics
from risk_sac.records.rates import BoundaryMap
from risk_sac.report.trend import EndedCampaign, EndedRun
from tests.builders import run_metrics

SOFTWARE = {"definitions": "10", "risk-sac": "1.0", "libsumo": "1.28.0", "torch": "2.10.0"}


def ended_campaign(
    version: str | None,
    kinds: Sequence[str] | None = (),
    *,
    versions: Mapping[str, str] = SOFTWARE,
    drawn: RunMetrics | None = None,
    ego: Mapping[str, Any] = {"driver": "idm-aeb"},
    requirements: Mapping[str, RequirementCounts] = {},
    boundary: BoundaryMap | None = None,
    **changes: Any,
) -> EndedCampaign:
    """Campaign of an ego's version: a search, and perhaps an i.i.d. run.

    Args:
      version: the maker's.
      kinds: headline kinds that the search has verified; None: without a replay.
      versions: of the software.
      drawn: metrics of the i.i.d. phase.
      ego: its settings.
      requirements: of the search.
      boundary: of a run of that method.
      changes: of the campaign's spec.
    """
    spec = CampaignSpec(families=("low",), methods=("archive",)).model_copy(update=changes)
    spec = CampaignSpec.model_validate(spec.model_dump() | {"ego": {**ego, "label": version}})
    told = {} if kinds is None else {"headline": len(kinds), "headline_kinds": tuple(kinds)}
    searched = run_metrics(300, **told, requirements=requirements)
    runs = [
        EndedRun(family="low", method="archive", iid=False, phases=(searched,), versions=versions, boundary=boundary)
    ]
    if drawn is not None:
        runs.append(EndedRun(family="low", method="iid-random", iid=True, phases=(drawn,), versions=versions))
    return EndedCampaign(id=f"c{version}", spec=spec, runs=runs)
