/** Campaigns beside each other: what each found so far, family by family, and in what they were posted differently. */

import { useState } from "preact/hooks";
import { get, save } from "../../api/client";
import { ended } from "../../api/ended";
import { usePolled } from "../../api/polled";
import type { Body } from "../../api/types";
import { address } from "../../router";
import { ScenarioNames } from "../../ui/scenario";
import { Empty, Failed, Loading } from "../../ui/states";
import { useTitle } from "../../ui/title";
import { COLOURS, type Mark } from "../campaign/look";
import { differences } from "./differences";
import { csv, json, markdown, type Line } from "./export";
import { Funnels, Measures, Methods } from "./methods";
import { ByRequirement } from "./requirements";
import { rowOfTotal } from "./rows";
import { Verdicts } from "./verdicts";

interface One {
  id: string;
  campaign?: Body<"Campaign">;
  results?: Body<"Results">;
  error?: Error;
}
type Found = Required<Omit<One, "error">>;

const AGAIN_MS = 10_000;
const LOST_MS = 2000;
const DASHES = [[], [8, 4], [2, 3], [10, 3, 2, 3]];

export function Several({ ids }: { ids: string[] }) {
  const all = useAll(ids);
  const found = all?.filter((one): one is Found => one.campaign !== undefined && one.results !== undefined) ?? [];
  const lines = linesOf(found);
  const families = [...new Set(lines.map((line) => line.family))];
  useTitle(`${ids.length} campaigns compared`);
  return (
    <div class="compare">
      <div class="head">
        <p class="crumbs">
          <a href="#/compare">Compare</a> / {ids.length} campaigns
        </p>
        <h1>Campaigns compared</h1>
        {lines.length > 0 && (
          <div class="actions">
            <span class="joined" role="group" aria-label="Download the comparison">
              <button onClick={() => save(new Blob([csv(lines)], { type: "text/csv" }), "campaigns.csv")}>CSV</button>
              <button onClick={() => save(new Blob([markdown(lines)], { type: "text/markdown" }), "campaigns.md")}>Markdown</button>
              <button onClick={() => save(new Blob([json(lines)], { type: "application/json" }), "campaigns.json")}>JSON</button>
            </span>
            <a class="button" href={address(["compare"], { choose: ids.join(",") })}>
              Choose others
            </a>
          </div>
        )}
      </div>
      {!all && <Loading what="campaigns" />}
      {all?.filter((one) => one.error).map((one) => (
        <Failed key={one.id} error={one.error!} />
      ))}
      {found.length > 0 && <Whichever found={found} />}
      {found.length > 1 && <Specs found={found} />}
      {all && found.length > 0 && families.length === 0 && <Empty>None of them has finished an episode.</Empty>}
      {families.map((family) => {
        const rows = lines.filter((line) => line.family === family).map((line) => line.row);
        return (
          <section key={family} class="card family" aria-labelledby={`family-${family}`}>
            <h2 id={`family-${family}`}>Family <ScenarioNames names={[family]} /></h2>
            <Methods what="Campaign" family={family} rows={rows} />
            <Funnels rows={rows} />
            <Verdicts what="Campaign" family={family} rows={rows} />
            <ByRequirement what="Campaign" family={family} rows={rows} />
            <Measures what="Campaign" family={family} rows={rows} />
          </section>
        );
      })}
      {families.length > 0 && (
        <p class="faint small">
          Runs of different campaigns are not paired, so nothing is tested here. Where intervals do not overlap, a difference is likely; post the methods in one campaign to have
          them tested.
        </p>
      )}
    </div>
  );
}

function Whichever({ found }: { found: Found[] }) {
  return (
    <ul class="whichever" aria-label="Campaigns">
      {found.map(({ id, campaign }, at) => (
        <li key={id} class="card">
          <b>{letter(at)}</b> <a href={address(["campaigns", id])}>{campaign.label || id}</a> <span class={`tag ${campaign.state}`}>{campaign.state}</span>
          <span class="faint small">
            {campaign.progress.episodes_done.toLocaleString("en")} of {campaign.progress.episodes_total.toLocaleString("en")} episodes
          </span>
        </li>
      ))}
    </ul>
  );
}

function Specs({ found }: { found: Found[] }) {
  const differing = differences(found.map(({ campaign }) => campaign.spec));
  return (
    <section class="card" aria-labelledby="specs">
      <h2 id="specs">What was posted differently</h2>
      {differing.length === 0 ? (
        <p class="faint">Nothing but the label.</p>
      ) : (
        <div class="scroll" tabIndex={0} role="region" aria-label="Differing fields">
          <table class="specs">
            <thead>
              <tr>
                <th scope="col">Field</th>
                {found.map(({ id, campaign }, at) => (
                  <th key={id} scope="col">
                    {letter(at)} <span class="faint">{campaign.label || id}</span>
                  </th>
                ))}
              </tr>
            </thead>
            <tbody>
              {differing.map(({ field, values }) => (
                <tr key={field}>
                  <th scope="row">
                    <code>
                      {field.split(".").map((part, at) => (at ? [".", <wbr key={at} />, part] : part))}
                    </code>
                  </th>
                  {values.map((value, at) => (
                    <td key={found[at]!.id}>{value}</td>
                  ))}
                </tr>
              ))}
            </tbody>
          </table>
        </div>
      )}
    </section>
  );
}

function letter(at: number): string {
  return String.fromCharCode(65 + at);
}

function linesOf(found: Found[]): Line[] {
  return found.flatMap(({ id, campaign, results }, at) =>
    results.totals.map((total) => {
      const name = `${letter(at)}: ${total.method}`;
      return { family: total.family, campaign: id, label: campaign.label, row: rowOfTotal(total, id, name, mark(at, campaign.spec.methods.indexOf(total.method))) };
    }),
  );
}

/** The colour is the campaign's here, the dash the method's. */
function mark(campaign: number, method: number): Mark {
  return { colour: COLOURS[campaign % COLOURS.length]!, dash: DASHES[Math.max(0, method) % DASHES.length]! };
}

/** All of them, each with what is wrong with it; asked again while one goes on. */
function useAll(ids: string[]): One[] | undefined {
  const asked = ids.join(",");
  const [state, setState] = useState<{ asked: string; all: One[] }>();
  usePolled(asked, async (left) => {
    const all = await Promise.all(ids.map((id) => one(id, left)));
    if (left.aborted) return null;
    const lost = all.some((each) => each.error instanceof TypeError);
    setState((before) => (lost && before?.asked === asked ? before : { asked, all })); // what was said last stays
    if (lost) return LOST_MS;
    return all.some(({ campaign }) => campaign && !ended(campaign)) ? AGAIN_MS : null;
  });
  return state?.asked === asked ? state.all : undefined;
}

async function one(id: string, signal: AbortSignal): Promise<One> {
  const path = `v1/campaigns/${encodeURIComponent(id)}`;
  try {
    const [campaign, results] = await Promise.all([get<Body<"Campaign">>(path, signal), get<Body<"Results">>(`${path}/results`, signal)]);
    return { id, campaign, results };
  } catch (error) {
    return { id, error: error as Error };
  }
}
