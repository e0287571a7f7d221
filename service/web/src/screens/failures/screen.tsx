/** A campaign's failures, and the violations that a rule refused. */

import "./failures.css";
import { useMemo } from "preact/hooks";
import { useAsked } from "../../api/asked";
import { ended } from "../../api/ended";
import type { Body } from "../../api/types";
import { address } from "../../router";
import { ScenarioNames } from "../../ui/scenario";
import { Empty, Shown } from "../../ui/states";
import { count } from "../../ui/text";
import { PUBLISHED } from "../../ui/verdicts";
import { useTitle } from "../../ui/title";
import { Explorer } from "./explorer";
import { queryOf, read, reset } from "./filters";
import type { FailureTable } from "./wire";

const RUNNING_MS = 5000;

export function FailuresScreen({ campaign, query }: { campaign: string; query: URLSearchParams }) {
  const path = `v1/campaigns/${encodeURIComponent(campaign)}`;
  const about = useAsked<Body<"Campaign">>(path, (campaign) => (ended(campaign) ? null : RUNNING_MS));
  const over = about.value !== undefined && ended(about.value);
  useTitle("Failures", about.value?.label || campaign);
  const asked = useAsked<FailureTable>(`${path}/failure-table?tier=raw`, () => (over ? null : RUNNING_MS));
  return (
    <div class="failures">
      <Head campaign={campaign} about={about.value} query={query} table={asked.value} />
      <Shown asked={asked} what="failures">
        {(table) => (table.ids.length ? <Explorer campaign={campaign} query={query} table={table} /> : <NothingFound about={about.value} />)}
      </Shown>
    </div>
  );
}

interface HeadProps {
  campaign: string;
  about: Body<"Campaign"> | undefined;
  query: URLSearchParams;
  table: FailureTable | undefined;
}

function Head({ campaign, about, query, table }: HeadProps) {
  const funnel = useMemo(() => table && funnelOf(table), [table]);
  const filters = read(query);
  const to = (tab: "failures" | "refused") =>
    address(["campaigns", campaign, "failures"], queryOf({ ...reset(filters), tab, family: filters.family }));
  return (
    <>
      <div class="head">
        <p class="crumbs">
          <a href="#/campaigns">Campaigns</a> / <a href={address(["campaigns", campaign])}>{about?.label || campaign}</a>
        </p>
        <h1>Failures</h1>
        {about && <span class={`tag ${about.state}`}>{about.state}</span>}
        {about && <ScenarioNames names={about.families} />}
        {funnel && (
          <ol class="funnel" aria-label="From failing episodes to the headline">
            {funnel.map(([name, number, meaning]) => (
              <li key={name} title={meaning}>
                <b>{count(number)}</b> {name}
              </li>
            ))}
          </ol>
        )}
      </div>
      {funnel && (
        <nav class="tabs" aria-label="What is shown">
          <a href={to("failures")} aria-current={filters.tab === "failures" ? "page" : undefined}>
            Failures <span class="faint">{count(funnel[0]![1])}</span>
          </a>
          <a href={to("refused")} aria-current={filters.tab === "refused" ? "page" : undefined}>
            Refused <span class="faint">{count(table!.ids.length - funnel[0]![1])}</span>
          </a>
        </nav>
      )}
    </>
  );
}

/** Each step of the funnel: its name, how many, and what it takes. */
function funnelOf({ valid, kind, variant, grade, prevented_by, headline, repeats }: FailureTable): [string, number, string][] {
  const kinds = (test: (i: number) => boolean) => new Set(kind.filter((_, i) => valid[i] && test(i))).size;
  const published = (i: number) => grade[i] === "preventable" && prevented_by[i]!.some((driver) => PUBLISHED.includes(driver));
  const replayed = repeats.some((each) => each !== null);
  const found: [string, number, string][] = [["headline", headline.filter(Boolean).length, "Preventable, at least moderate, and the same in each replay"]];
  return [
    ["failing episodes", valid.filter(Boolean).length, "Episodes in which a requirement that counts was violated, and no rule refused the violation"],
    ["variants", new Set(variant.filter((each) => each !== null)).size, "Different failures; kinds are divided into them"],
    ["kinds", kinds(() => true), "Kinds of failures; what several runs found alike counts once"],
    ["preventable", kinds((i) => grade[i] === "preventable"), "Kinds with a failure that a reference driver would have prevented"],
    ["published", kinds(published), "Of these, kinds with a failure that R157, FSM or RSS would have prevented"],
    ...(replayed ? found : []),
  ];
}

function NothingFound({ about }: { about: Body<"Campaign"> | undefined }) {
  const running = about && !ended(about);
  return (
    <Empty>
      <h2>{running ? "Nothing has been found yet" : "Nothing was found"}</h2>
      {about && (
        <p>
          {count(about.progress.episodes_done)} of {count(about.progress.episodes_total)} episodes are done
          {running ? "; failures appear here as they are found." : "; none of them violated a requirement that counts."}
        </p>
      )}
      {about && <a href={address(["campaigns", about.id])}>To the campaign</a>}
    </Empty>
  );
}
