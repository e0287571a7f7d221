/** The start page: each ego with its newest campaign, its headline kinds and its versions. */

import { useAsked } from "../../api/asked";
import { ended } from "../../api/ended";
import type { Body } from "../../api/types";
import { address } from "../../router";
import { ScenarioNames } from "../../ui/scenario";
import { Shown } from "../../ui/states";
import { count, headlineWords, moment, seconds } from "../../ui/text";
import { useTitle } from "../../ui/title";
import { useListed, type Listed } from "../campaigns/listed";
import { Bar, nameOf } from "../campaigns/table";
import { kindsOf, nameOf as versionOf, type Row } from "../trend/points";
import { bars, byEgo, newestRow, type EgoCampaigns } from "./egos";
import { FirstSteps } from "./first";
import "./home.css";

const RUNNING_MS = 15_000;
const MOST_KINDS = 5;
const MOST_VERSIONS = 6;

export function HomeScreen() {
  useTitle("Egos");
  const listed = useListed({}, 1);
  return (
    <div class="home grid">
      <Shown asked={listed} what="your egos">
        {({ items, more }) =>
          items.length === 0 ? (
            <FirstSteps />
          ) : (
            <>
              <div class="head">
                <h1>Egos under test</h1>
                <Queue campaigns={items} />
                <div class="actions">
                  <a class="button primary" href="#/new">
                    New campaign
                  </a>
                </div>
              </div>
              <ul class="egos">
                {byEgo(items).map((ego) => (
                  <Ego key={ego.name} {...ego} />
                ))}
              </ul>
              {more && (
                <p class="faint small">
                  Of the newest {count(items.length)} campaigns. <a href="#/campaigns">All campaigns</a>
                </p>
              )}
            </>
          )
        }
      </Shown>
      <nav class="places" aria-label="Further places">
        <Place to="#/scenarios" title="Scenarios" about="situations that ship with the service, and your own" />
        <Place to="#/campaigns" title="Campaigns" about="all searches, to filter, compare and delete" />
        <Place to="#/maps" title="Maps" about="road networks of your own, and what fits on them" />
      </nav>
    </div>
  );
}

function Place({ to, title, about }: { to: string; title: string; about: string }) {
  return (
    <a class="card place" href={to}>
      <b>{title}</b> <span class="faint small">{about}</span>
    </a>
  );
}

/** How many campaigns are at work and wait, of those that are listed. */
function Queue({ campaigns }: { campaigns: Listed[] }) {
  const states = (["running", "queued", "paused"] as const).flatMap((state) => {
    const found = campaigns.filter((campaign) => campaign.state === state).length;
    return found ? [[state, found] as const] : [];
  });
  return (
    <>
      {states.map(([state, found]) => (
        <a key={state} class={`tag ${state}`} href={address(["campaigns"], { state })}>
          {count(found)} {state}
        </a>
      ))}
    </>
  );
}

function Ego({ name, campaigns }: EgoCampaigns) {
  const atWork = campaigns.filter((campaign) => !ended(campaign));
  const path = `v1/egos/${encodeURIComponent(name)}/trend`;
  const trend = useAsked<Body<"Trend">>(path, () => (atWork.length ? RUNNING_MS : null));
  const newest = campaigns[0]!;
  const row = newestRow(trend.value?.rows ?? [], campaigns);
  const { label, defects } = newest.ego;
  return (
    <li class="card ego-card" data-ego={name}>
      <h2>
        <a href={address(["trend"], { ego: name })}>{name}</a> {label && <span class="tag">{label}</span>}
        {defects.map((defect) => (
          <span key={defect} class="tag" title="a known fault, planted">
            {defect}
          </span>
        ))}
      </h2>
      <div class="newest-campaign">
        <p>
          <a href={address(["campaigns", newest.id])}>
            <bdi>{nameOf(newest)}</bdi>
          </a>{" "}
          <span class={`tag ${newest.state}`}>{newest.state}</span> <span class="faint small">{moment(newest.created_at)}</span>
        </p>
        <ScenarioNames names={newest.families} />
        <p>
          {headlineWords(newest.progress)} <span class="faint">of {count(newest.progress.failures)} valid failures in {count(newest.progress.episodes_done)} episodes</span>
        </p>
      </div>
      {atWork.length > 0 && <AtWork campaigns={atWork} />}
      {row && <HeadlineKinds row={row} />}
      {row && <Versions ego={name} row={row} />}
      <div class="row">
        <a class="button" href={address(["new"], { from: newest.id })}>
          Test {name} again
        </a>
        <a class="button" href={address(["campaigns", newest.id, "failures"])} aria-label={`Failures of ${nameOf(newest)}`}>
          Failures
        </a>
      </div>
    </li>
  );
}

function AtWork({ campaigns }: { campaigns: Listed[] }) {
  return (
    <section aria-label="Running">
      <h3>Running</h3>
      <ul class="at-work">
        {campaigns.map((campaign) => (
          <li key={campaign.id}>
            <a href={address(["campaigns", campaign.id])}>{nameOf(campaign)}</a>
            <Bar done={campaign.progress.episodes_done} total={campaign.progress.episodes_total} name={nameOf(campaign)} />
            <span class="faint small">{campaign.progress.eta_s === null ? campaign.state : `${seconds(campaign.progress.eta_s)} left`}</span>
          </li>
        ))}
      </ul>
    </section>
  );
}

/** Kinds of the newest version, each with what became of it since the version before. */
function HeadlineKinds({ row }: { row: Row }) {
  const point = row.points.at(-1)!;
  const kinds = kindsOf(row).flatMap(([kind, changes]) => (point.kinds?.includes(kind) ? [[kind, changes.at(-1)!] as const] : []));
  const gone = point.gone?.length ?? 0;
  return (
    <section>
      <h3>Headline kinds of {point.version}</h3>
      {point.kinds === null && <p class="faint small">They are counted once the failures are replayed.</p>}
      {point.kinds?.length === 0 && <p class="faint small">None: no failure is plausible, preventable, at least moderate and verified.</p>}
      <ul class="headline-kinds">
        {kinds.slice(0, MOST_KINDS).map(([kind, change]) => (
          <li key={kind}>
            <a href={address(["campaigns", point.campaign_id, "failures"], { kind })}>{kind}</a> {["new", "returned"].includes(change) && <b class="bad small">{change}</b>}
          </li>
        ))}
      </ul>
      {kinds.length > MOST_KINDS && <a href={address(["campaigns", point.campaign_id, "failures"])}>{count(kinds.length - MOST_KINDS)} more</a>}
      {gone > 0 && <p class="faint small">{count(gone)} of the version before not found again.</p>}
    </section>
  );
}

/** Headline kinds by version, as bars; a dashed line where versions are not comparable. */
function Versions({ ego, row }: { ego: string; row: Row }) {
  const lengths = bars(row.points);
  const first = Math.max(0, row.points.length - MOST_VERSIONS);
  return (
    <section>
      <h3>
        Versions <span class="faint small">headline kinds</span>
      </h3>
      <ol class="ego-versions">
        {row.points.slice(first).map((point, at) => (
          <li key={point.campaign_id} data-changed={point.changed.join(" ") || undefined} title={point.changed.length ? `Not comparable with the version before: ${point.changed.join(", ")}` : undefined}>
            <a href={address(["campaigns", point.campaign_id])} title={versionOf(point)}>
              {point.version}
            </a>
            <span class="version-bar" aria-hidden="true">
              <span style={{ width: `${lengths[first + at] ?? 0}%` }} />
            </span>
            <b>{point.headline === null ? "–" : count(point.headline)}</b>
          </li>
        ))}
      </ol>
      <a class="small" href={address(["trend"], { ego })}>
        {first > 0 ? `All ${count(row.points.length)} versions` : "Rates and requirements"}
      </a>
    </section>
  );
}
