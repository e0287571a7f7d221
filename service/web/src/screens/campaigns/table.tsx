/** The list as a table: one row for each campaign, and heads that sort. */

import { Fragment, type ComponentChildren } from "preact";
import { ended } from "../../api/ended";
import { address } from "../../router";
import { ScenarioNames } from "../../ui/scenario";
import { Tags } from "../../ui/tags";
import { count, egoWords, headlineWords, moment, percent, seconds } from "../../ui/text";
import type { Listed } from "./listed";
import { clicked, type Column, type Order } from "./order";
import { Sparkline } from "./sparkline";

const HEADS: { column: Column; title: string; number?: boolean; hint?: string }[] = [
  { column: "label", title: "Campaign" },
  { column: "state", title: "State" },
  { column: "families", title: "Families" },
  { column: "methods", title: "Methods" },
  { column: "ego", title: "Ego" },
  { column: "progress", title: "Episodes" },
  { column: "ecr", title: "ECR", hint: "valid collisions per episode, over each run's newest 100 episodes" },
  {
    column: "headline",
    title: "Head\u00adline",
    number: true,
    hint: "kinds of failures that are preventable, plausible, not minor and the same when replayed; in brackets those that R157, FSM or RSS would have prevented",
  },
  { column: "distinct", title: "Distinct", number: true, hint: "kinds of valid failures, summed over the runs" },
  {
    column: "preventable",
    title: "Prevent\u00adable",
    number: true,
    hint: "kinds that a reference driver would have prevented; in brackets those that R157, FSM or RSS would have prevented",
  },
  { column: "eta", title: "ETA", number: true, hint: "time until it ends at its present pace" },
  { column: "created", title: "Created", number: true },
];

interface Shown {
  campaigns: readonly Listed[];
  learners: readonly string[];
  order: Order;
  /** Of the list, which a click on a tag keeps. */
  filters: Record<string, string | undefined>;
  sort: (order: Order) => void;
  chosen: ReadonlySet<string>;
  choose: (ids: ReadonlySet<string>) => void;
  ask: (verb: "cancel" | "delete", campaigns: readonly Listed[]) => void;
}

export function CampaignTable({ campaigns, learners, order, filters, sort, chosen, choose, ask }: Shown) {
  const all = campaigns.length > 0 && campaigns.every((each) => chosen.has(each.id));
  return (
    <div class="scroll card campaigns-card" tabIndex={0} role="region" aria-label="Campaigns">
      <table class="campaigns">
        <thead>
          <tr>
            <th>
              <input
                type="checkbox"
                aria-label="Select all"
                checked={all}
                onChange={() => choose(new Set(all ? [] : campaigns.map((each) => each.id)))}
              />
            </th>
            {HEADS.map((head) => (
              <Head key={head.column} {...head} order={order} sort={sort} />
            ))}
            <th>
              <span class="hidden-label">What can be done</span>
            </th>
          </tr>
        </thead>
        <tbody>
          {campaigns.map((campaign) => (
            <tr key={campaign.id} class={chosen.has(campaign.id) ? "chosen" : undefined}>
              <td>
                <input
                  type="checkbox"
                  aria-label={`Select ${nameOf(campaign)}`}
                  checked={chosen.has(campaign.id)}
                  onChange={() => choose(toggled(chosen, campaign.id))}
                />
              </td>
              <Cells campaign={campaign} learners={learners} filters={filters} />
              <td class="row-actions">
                <a class="button" href={address(["new"], { from: campaign.id })} aria-label={`Clone ${nameOf(campaign)}`}>
                  Clone
                </a>
                {ended(campaign) ? (
                  <Act verb="Delete" name={nameOf(campaign)} act={() => ask("delete", [campaign])} />
                ) : (
                  <Act verb="Cancel" name={nameOf(campaign)} act={() => ask("cancel", [campaign])} />
                )}
              </td>
            </tr>
          ))}
        </tbody>
      </table>
    </div>
  );
}

export function nameOf(campaign: Listed): string {
  return campaign.label || campaign.id;
}

type HeadShown = (typeof HEADS)[number] & Pick<Shown, "order" | "sort">;

function Head({ column, title, number, hint, order, sort }: HeadShown) {
  const current = order.column === column;
  const way = order.descending ? "descending" : "ascending";
  return (
    <th class={number ? "number" : undefined} aria-sort={current ? way : undefined} title={hint}>
      <button onClick={() => sort(clicked(order, column))}>
        {title}
        <span aria-hidden="true" class="way">
          {current ? (order.descending ? "▾" : "▴") : ""}
        </span>
      </button>
    </th>
  );
}

function Act({ verb, name, act }: { verb: string; name: string; act: () => void }) {
  return (
    <button class="danger" aria-label={`${verb} ${name}`} onClick={act}>
      {verb}
    </button>
  );
}

function Cells({ campaign, learners, filters }: { campaign: Listed } & Pick<Shown, "learners" | "filters">) {
  const { progress, ego } = campaign;
  return (
    <>
      <td class="campaign-name">
        <a href={address(["campaigns", campaign.id])} title={campaign.label || undefined}>
          <bdi>{nameOf(campaign)}</bdi>
        </a>
        {campaign.label && <code class="faint">{campaign.id}</code>}
        <Tags tags={campaign.tags} filters={filters} />
      </td>
      <td data-head="State">
        <span class={`tag ${campaign.state}`} title={campaign.reason ?? undefined}>
          {campaign.state}
        </span>
        {campaign.reason && <span class="reason small">{campaign.reason}</span>}
      </td>
      <td data-head="Families" class="wraps">
        <ScenarioNames names={campaign.families} />
      </td>
      <td data-head="Methods" class="wraps" title={campaign.methods.join(", ")}>
        <Several names={campaign.methods} />
      </td>
      <td data-head="Ego" class="wraps">
        {egoWords(ego)}
      </td>
      <td data-head="Episodes">
        <Bar done={progress.episodes_done} total={progress.episodes_total} name={nameOf(campaign)} />
      </td>
      <td data-head="ECR">
        <Sparkline campaign={campaign} learners={learners} />
        <span class="small faint">{percent(progress.window_ecr)}</span>
      </td>
      <td data-head="Headline" class="number" title={headlineWords(progress)}>{progress.headline === null ? "–" : `${count(progress.headline)} (${count(progress.headline_published ?? 0)})`}</td>
      <td data-head="Distinct" class="number">{count(progress.distinct_failures)}</td>
      <td data-head="Preventable" class="number">{count(progress.distinct_preventable)} ({count(progress.distinct_published)})</td>
      <td data-head="ETA" class="number">{remaining(campaign)}</td>
      <td data-head="Created" class="number">
        <Created at={campaign.created_at} />
      </td>
    </>
  );
}

const MOST_NAMES = 3;

/** A name is not broken at its hyphens. */
function Several({ names }: { names: readonly string[] }) {
  const left = names.length - MOST_NAMES;
  const shown = left <= 1 ? names : names.slice(0, MOST_NAMES);
  return (
    <>
      {shown.map((name, i) => (
        <Fragment key={name}>
          <span class="name">{name + (i < shown.length - 1 ? "," : "")}</span>{" "}
        </Fragment>
      ))}
      {left > 1 && <span class="name">and {left} more</span>}
    </>
  );
}

export function Bar({ done, total, name }: { done: number; total: number; name: string }) {
  return (
    <>
      <div class="progress" role="progressbar" aria-label={`Episodes of ${name}`} aria-valuenow={done} aria-valuemin={0} aria-valuemax={total}>
        <span style={{ width: `${(100 * done) / Math.max(1, total)}%` }} />
      </div>
      <span class="small faint">{done === total ? count(total) : `${count(done)} of ${count(total)}`}</span>
    </>
  );
}

function remaining(campaign: Listed): ComponentChildren {
  if (!ended(campaign)) return seconds(campaign.progress.eta_s);
  if (campaign.started_at === null || campaign.finished_at === null) return "–";
  const took = (Date.parse(campaign.finished_at) - Date.parse(campaign.started_at)) / 1000;
  return (
    <span class="faint small">
      took
      <br />
      {seconds(took)}
    </span>
  );
}

function Created({ at }: { at: string }) {
  const when = new Date(at);
  return (
    <time dateTime={at} title={moment(at)}>
      {when.toLocaleDateString("en-GB", { day: "numeric", month: "short" })}
      <br />
      <span class="small faint">{when.toLocaleTimeString("en-GB", { timeStyle: "short" })}</span>
    </time>
  );
}

function toggled(chosen: ReadonlySet<string>, id: string): Set<string> {
  const next = new Set(chosen);
  if (!next.delete(id)) next.add(id);
  return next;
}
