"""One RISK-SAC service, as Python methods."""

import io
import json
import os
import zipfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Literal, Self, TypeVar
from urllib.parse import quote
from uuid import uuid4

from risk_sac.client.transport import (
    AWAY_S,
    DEFAULT_URL,
    Event,
    Transport,
    UnexpectedAnswer,
    api_key,
    checked_key,
    checked_url,
    events,
    follow,
    read,
)
from risk_sac.config import CampaignSpec, EgoConfig, Scenario
from risk_sac.failures.studied import Aim, CampaignRegression
from risk_sac.records import (
    Campaign,
    CampaignPage,
    CampaignSummary,
    DrivenBy,
    Episode,
    EpisodePage,
    Failure,
    FailureOrder,
    Fault,
    Grade,
    Page,
    PlausibilityClass,
    Power,
    Record,
    Results,
    Severity,
)
from risk_sac.records.campaign import ScenarioDetails, ScenarioList, ScenarioSummary
from risk_sac.records.rates import BoundaryMap
from risk_sac.scenario.library import written

TIMEOUT_S = 30.0  # longest silence within one answer
PATIENCE_S = 10.0  # longest wait for a service that does not answer
MAKING_S = 300.0  # the same where the service has to play something for its answer
PAGE = 100  # number of items that one request asks for
PNG, BUNDLE = "image/png", "application/zip"

Query = dict[str, str | int | None]
R = TypeVar("R", bound=Record)


class NetworkName(Record):
    """Id and label of an uploaded network."""

    id: str
    label: str


class NetworkNames(Page[NetworkName]):
    """Networks, newest first."""


class Client:
    """Client of campaigns and their results; threads may share it.

    Every method raises a `ClientError`: `Refused` with the service's reason, `Unreachable`, or `UnexpectedAnswer`. What
    may pass by itself (a connection refused or broken, 429, 502, 503, 504) is asked again where that can do no harm.
    """

    def __init__(
        self,
        url: str = DEFAULT_URL,
        key: str | None = None,
        *,
        timeout_s: float = TIMEOUT_S,
        patience_s: float = PATIENCE_S,
    ) -> None:
        """Connects to nothing yet.

        Args:
          url: of the service, with the path it is mounted at, if any.
          key: API key; none is needed where the service listens on loopback only.
          timeout_s: how long the service may be silent within one answer.
          patience_s: how long a call is tried again, unless the service was there before and follows a campaign.

        Raises:
          ConfigError: the URL or the key cannot be one.
        """
        self.url = checked_url(url)
        self._transport = Transport(self.url, None if key is None else checked_key(key), timeout_s, patience_s)

    @classmethod
    def from_environment(cls, url: str | None = None) -> Self:
        """The client that RISK_SAC_URL and RISK_SAC_API_KEY, or the file RISK_SAC_API_KEY_FILE, describe.

        Raises:
          ConfigError: one of them cannot be used.
        """
        return cls(url or os.environ.get("RISK_SAC_URL") or DEFAULT_URL, api_key(os.environ))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Closes the connections."""
        self._transport.close()

    def url_of(self, campaign_id: str) -> str:
        """Returns the REST address of a campaign."""
        return f"{self.url}/{_path(campaign_id)}"

    def submit(self, spec: CampaignSpec | Mapping[str, Any], idempotency_key: str | None = None) -> Campaign:
        """Queues a campaign.

        Args:
          spec: what to search. Only what it was given is sent; the service fills in the rest.
          idempotency_key: the same key with the same spec gives the same campaign, whenever and however often it is
            posted; by default a new one, so that a lost answer makes no second campaign.
        """
        body = spec.model_dump_json(exclude_unset=True) if isinstance(spec, CampaignSpec) else json.dumps(spec)
        key = uuid4().hex if idempotency_key is None else idempotency_key
        headers = {"Idempotency-Key": key}
        return read(Campaign, self._transport.ask("POST", "v1/campaigns", headers=headers, body=body))

    def campaigns(
        self,
        *,
        state: str | None = None,
        family: str | None = None,
        method: str | None = None,
        label: str | None = None,
        tag: str | None = None,
        page: int = PAGE,
    ) -> Iterator[CampaignSummary]:
        """Yields campaigns, newest first, and reads further pages as needed."""
        query: Query = {"state": state, "family": family, "method": method, "label": label, "tag": tag}
        return self._items(CampaignPage, "v1/campaigns", query | {"limit": page})

    def tag(self, campaign_id: str, tags: Sequence[str]) -> Campaign:
        """Replaces the tags of a campaign."""
        body = json.dumps({"tags": list(tags)})
        return read(Campaign, self._transport.ask("PUT", f"{_path(campaign_id)}/tags", body=body))

    def networks(self) -> Iterator[NetworkName]:
        """Uploaded networks, newest first."""
        return self._items(NetworkNames, "v1/networks", {"limit": PAGE})

    def scenarios(self) -> list[ScenarioSummary]:
        """Scenarios that ship with the service, then the project's own, newest first."""
        return self._get(ScenarioList, "v1/scenarios").items

    def scenario(self, name: str) -> ScenarioDetails:
        """Returns a scenario with its document."""
        return self._get(ScenarioDetails, f"v1/scenarios/{_part(name)}")

    def add_scenario(self, document: Scenario, nets: Mapping[str, bytes] = {}) -> ScenarioDetails:
        """Stores a scenario for campaigns to name; returns an equal stored one.

        Args:
          document: of the scenario.
          nets: network of the document → its SUMO net; shipped ones are left out.
        """
        content = io.BytesIO()
        with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr("scenario.yaml", written(document))
            for name, net in nets.items():
                archive.writestr(name, net)
        headers = {"Content-Type": "application/zip"}
        response = self._transport.ask("POST", "v1/scenarios", headers=headers, body=content.getvalue())
        return read(ScenarioDetails, response)

    def scenario_picture(self, name: str) -> bytes:
        """Returns a picture of a scenario from above as a PNG."""
        return self._transport.ask("GET", f"v1/scenarios/{_part(name)}/picture.png", patience_s=MAKING_S).content

    def delete_scenario(self, name: str) -> None:
        """Deletes a scenario that no campaign names."""
        self._transport.ask("DELETE", f"v1/scenarios/{_part(name)}")

    def campaign(self, campaign_id: str) -> Campaign:
        """State, progress and runs of a campaign."""
        return self._get(Campaign, _path(campaign_id))

    def results(self, campaign_id: str) -> Results:
        """Returns the results of a campaign so far."""
        return self._get(Results, f"{_path(campaign_id)}/results")

    def boundary(self, campaign_id: str, run_id: str) -> BoundaryMap:
        """Returns a `boundary` run's map from passing to failing."""
        return self._get(BoundaryMap, f"{_path(campaign_id)}/runs/{_part(run_id)}/boundary")

    def power(self, campaign_id: str) -> Power:
        """Returns how many known defects the budget detects, by stored benchmark runs."""
        return self._get(Power, f"{_path(campaign_id)}/power")

    def failures(
        self,
        campaign_id: str,
        *,
        run: str | None = None,
        tier: Literal["valid", "raw"] = "valid",
        requirement: str | None = None,
        grade: Grade | None = None,
        plausibility: PlausibilityClass | None = None,
        severity: Severity | None = None,
        fault: Fault | None = None,
        driven_by: DrivenBy | None = None,
        broke: str | None = None,
        kind: str | None = None,
        order: FailureOrder = "arrival",
        page: int = PAGE,
    ) -> Iterator[Episode]:
        """Yields failures in an order, and reads further pages as needed."""
        query: Query = {"run": run, "tier": tier, "requirement": requirement, "grade": grade, "broke": broke}
        query |= {"plausibility": plausibility, "severity": severity, "fault": fault, "driven_by": driven_by}
        query |= {"kind": kind, "order": order, "limit": page}
        return self._items(EpisodePage, f"{_path(campaign_id)}/failures", query)

    def failure(self, campaign_id: str, failure_id: str) -> Failure:
        """One failure with its full time series."""
        return self._get(Failure, f"{_path(campaign_id)}/failures/{_part(failure_id)}")

    def picture(self, campaign_id: str, failure_id: str, twin: str | None = None) -> bytes:
        """Returns one failure as a PNG.

        Args:
          campaign_id: of the campaign.
          failure_id: of the failure.
          twin: draws beside it the undisturbed scene (idle), or the one with that ego.
        """
        return self._made(campaign_id, failure_id, "picture.png" if twin is None else f"twins/{_part(twin)}.png", PNG)

    def export(self, campaign_id: str, failure_id: str, format_: str) -> bytes:
        """Exports a failure in a format ("openscenario"); several files as a zip."""
        path = f"{_path(campaign_id)}/failures/{_part(failure_id)}/export"
        return self._transport.ask("GET", path, query={"format": format_}, patience_s=MAKING_S).content

    def bundle(self, campaign_id: str, failure_id: str, *, aim: Aim | None = None) -> bytes:
        """Returns a self-contained file of a failure; minimising (`aim`) takes 10-20 s."""
        names = {None: "bundle.npz", "smallest": "core.npz", "most-plausible": "most-plausible.npz"}
        return self._made(campaign_id, failure_id, names[aim], BUNDLE)

    def regress(self, campaign_id: str, ego: EgoConfig) -> CampaignRegression:
        """Plays a campaign's distinct failures against another ego; reuses an equal regression."""
        body = json.dumps({"campaign_id": campaign_id, "ego": ego.model_dump(mode="json", exclude_unset=True)})
        return read(CampaignRegression, self._transport.ask("POST", "v1/regressions", body=body))

    def regression(self, regression_id: str) -> CampaignRegression:
        """Returns the state and the cases of a regression so far."""
        return self._get(CampaignRegression, f"v1/regressions/{_part(regression_id)}")

    def _made(self, campaign_id: str, failure_id: str, what: str, wanted: str) -> bytes:
        path = f"{_path(campaign_id)}/failures/{_part(failure_id)}/{what}"
        response = self._transport.ask("GET", path, patience_s=MAKING_S)
        if response.headers.get("content-type") != wanted:
            raise UnexpectedAnswer(response, wanted)
        return response.content

    def table(self, campaign_id: str, format_: Literal["json", "md", "csv"] = "md") -> str:
        """The methods compared over seeds by the runs that have finished."""
        return self._transport.ask("GET", f"{_path(campaign_id)}/table", query={"format": format_}).text

    def rates(self, campaign_id: str, exposure: float | None = None) -> str:
        """Returns failure rates of finished runs of the method `rate`, as JSON.

        With an exposure, scenes in an hour, they are per hour, too.
        """
        query = {"exposure": None if exposure is None else str(exposure)}
        return self._transport.ask("GET", f"{_path(campaign_id)}/rates", query=query).text

    def report(
        self, campaign_id: str, format_: Literal["json", "md", "html"] = "md", regression_id: str | None = None
    ) -> str:
        """Returns a campaign's report; JSON has only bounds and coverage, no regression."""
        query = {"format": format_, "regression": regression_id}
        return self._transport.ask("GET", f"{_path(campaign_id)}/report", query=query).text

    def cancel(self, campaign_id: str) -> Campaign:
        """Cancels a campaign, keeping results; takes a while, no-op once ended."""
        return read(Campaign, self._transport.ask("POST", f"{_path(campaign_id)}/cancel"))

    def delete(self, campaign_id: str) -> None:
        """Deletes a campaign that has ended, with all its files."""
        self._transport.ask("DELETE", _path(campaign_id), repeatable=False)

    def events(self, campaign_id: str, last_event_id: str | None = None, *, away_s: float = AWAY_S) -> Iterator[Event]:
        """Yields finished episodes, failures and state changes until the campaign ends.

        A stream that breaks continues after the last event that arrived.

        Args:
          campaign_id: of the campaign.
          last_event_id: `id` of an event; the stream starts after it.
          away_s: how long the service may be unreachable in between.
        """
        return events(self._transport, _path(campaign_id), last_event_id, away_s)

    def follow(self, campaign_id: str, *, timeout_s: float | None = None, away_s: float = AWAY_S) -> Iterator[Campaign]:
        """Yields the campaign now and after each change, until it ends.

        Args:
          campaign_id: of the campaign.
          timeout_s: after which `Overdue` is raised.
          away_s: how long the service may be unreachable once the campaign was seen.
        """
        return follow(self._transport, _path(campaign_id), timeout_s, away_s)

    def wait(
        self,
        campaign_id: str,
        on_change: Callable[[Campaign], None] | None = None,
        *,
        timeout_s: float | None = None,
        away_s: float = AWAY_S,
    ) -> Campaign:
        """Returns the ended campaign; calls `on_change` with each state before."""
        for campaign in self.follow(campaign_id, timeout_s=timeout_s, away_s=away_s):
            if on_change is not None:
                on_change(campaign)
        return campaign

    def _get(self, record: type[R], path: str, patience_s: float | None = None) -> R:
        return read(record, self._transport.ask("GET", path, patience_s=patience_s))

    def _items(self, page: type[Page[R]], path: str, query: Query) -> Iterator[R]:
        while True:
            answer = read(page, self._transport.ask("GET", path, query=query))
            yield from answer.items
            if answer.next is None:
                return
            query = query | {"cursor": answer.next}


def _path(campaign_id: str) -> str:
    return f"v1/campaigns/{_part(campaign_id)}"


def _part(id_: str) -> str:
    """Quotes an id as one part of a path, including slashes."""
    return quote(id_, safe="", errors="replace")
