"""Bodies of a campaign's report, beside its table."""

from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import Field

from risk_sac.config import FamilyName
from risk_sac.failures.clusters import Overview
from risk_sac.records import Record


class Clusters(Record):
    """The failures of the finished runs, sorted into kinds; flaky ones are left out."""

    complete: bool
    """Whether all runs are in them."""
    families: Mapping[FamilyName, Overview]
    """Those with a finished run."""


class FigureFile(Record):
    """A figure in one format."""

    format: Literal["png", "svg"]
    media_type: Annotated[str, Field(examples=["image/svg+xml"])]
    href: Annotated[str, Field(examples=["/v1/campaigns/ca39e56a9cd896b07/figures/ecr_low.svg"])]
    """Where it is."""


class Figure(Record):
    """A figure of the report."""

    name: Annotated[str, Field(examples=["ecr_low", "bars_rho_c_evaluation"])]
    """With a family: `ecr_`, `pcr_`, `lambda_` and `alpha_`, curves over the search; `preventable_found_` and
    `distinct_found_`, what was found over processor time; `times_`, histograms of the time
    from the adversaries' release to conflict and contact. `bars_` with a metric: all families."""
    files: list[FigureFile]


class Figures(Record):
    """The figures that the finished runs allow."""

    complete: bool
    """Whether all runs are in them."""
    items: list[Figure]
    """None before a run has finished."""
