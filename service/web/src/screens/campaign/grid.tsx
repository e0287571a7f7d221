/** The standard's verdict on each scene of a run that plays its scenario as it is written. */

import { useState } from "preact/hooks";
import { useAsked } from "../../api/asked";
import { download } from "../../api/client";
import { ended } from "../../api/ended";
import type { Body } from "../../api/types";
import { usePicture } from "../../ui/picture";
import { Empty, Shown } from "../../ui/states";
import { count, number } from "../../ui/text";
import { runName } from "./look";

type Grid = Body<"PlayedGrid">;

const AGAIN_MS = 15_000;
const MOST_ROWS = 200;
const VERDICTS = { fail: "Fail", out_of_scope: "Out of scope", pass: "Pass", refused: "Refused", unjudged: "Unjudged" } as const;

export function Grids({ campaign }: { campaign: Body<"Campaign"> }) {
  const runs = campaign.runs.filter((run) => run.method.startsWith("story-"));
  const [chosen, choose] = useState("");
  const run = runs.find(({ id }) => id === chosen) ?? runs[0];
  if (!run) return null;
  return (
    <section aria-labelledby="grid-title">
      <div class="row over-row">
        <h2 id="grid-title">Verdicts on scenes</h2>
        {runs.length > 1 && (
          <span class="joined" role="group" aria-label="Run of the verdicts">
            {runs.map((one) => (
              <button key={one.id} aria-pressed={one === run} onClick={() => choose(one.id)}>
                {runName(campaign.spec, one)}
              </button>
            ))}
          </span>
        )}
      </div>
      <OfRun key={run.id} path={`v1/campaigns/${encodeURIComponent(campaign.id)}/runs/${run.id}/grid`} run={run} />
    </section>
  );
}

function OfRun({ path, run }: { path: string; run: Body<"Run"> }) {
  const asked = useAsked<Grid>(path, () => (ended(run) ? null : AGAIN_MS));
  const [refused, setRefused] = useState("");
  const save = (format: string) =>
    download(`${path}?format=${format}`, `${run.id}.${format}`).then(() => setRefused(""), (error: Error) => setRefused(error.message));
  return (
    <Shown asked={asked} what="the verdicts">
      {(grid) => {
        const varied = variedOf(grid);
        if (!grid.points.length) return <Empty>No scene was played yet.</Empty>;
        return (
          <div class="scenes">
            <div class="card">
              <h3>By UN R157's competent driver</h3>
              <p class="small faint">
                {Object.entries(VERDICTS)
                  .map(([verdict, word]) => `${word.toLowerCase()} ${count(grid.points.filter((point) => point.verdict === verdict).length)}`)
                  .join(", ")}
                . Out of scope: the competent driver does not avoid the contact either.
              </p>
              <Points grid={grid} varied={varied} />
              <p class="row">
                <span class="joined" role="group" aria-label="Download the verdicts">
                  <button onClick={() => save("csv")}>CSV</button>
                  <button onClick={() => save("xml")}>JUnit</button>
                </span>
                {refused && <span role="alert" class="bad small">{refused}</span>}
              </p>
            </div>
            {varied.length > 1 && <Over path={path} varied={varied} edition={grid.points.length} />}
          </div>
        );
      }}
    </Shown>
  );
}

/** Parameters of which the scenes have several values. */
function variedOf({ points }: Grid): string[] {
  const names = Object.keys(points[0]?.values ?? {});
  return names.filter((name) => new Set(points.map((point) => point.values[name])).size > 1);
}

function Points({ grid, varied }: { grid: Grid; varied: string[] }) {
  const order = Object.keys(VERDICTS);
  const points = [...grid.points].sort((one, other) => order.indexOf(one.verdict) - order.indexOf(other.verdict));
  return (
    <div class="scroll points" tabIndex={0} role="region" aria-label="Verdict on each scene">
      <table>
        <thead>
          <tr>
            <th>Verdict</th>
            {varied.map((name) => (
              <th key={name}>{name}</th>
            ))}
            <th>Failure, or why it does not count</th>
          </tr>
        </thead>
        <tbody>
          {points.slice(0, MOST_ROWS).map((point) => (
            <tr key={point.id} data-scene={point.id}>
              <th scope="row" title={point.id}>
                {VERDICTS[point.verdict]}
              </th>
              {varied.map((name) => (
                <td key={name}>{cell(point.values[name])}</td>
              ))}
              <td>{point.kind || point.reason}</td>
            </tr>
          ))}
        </tbody>
      </table>
      {points.length > MOST_ROWS && <p class="small faint">The first {MOST_ROWS} of {count(points.length)} scenes; the CSV has all.</p>}
    </div>
  );
}

function cell(value: string | number | undefined): string {
  return typeof value === "number" ? number(value, 2) : (value ?? "");
}

function Over({ path, varied, edition }: { path: string; varied: string[]; edition: number }) {
  const [across, setAcross] = useState(varied[0]!);
  const [up, setUp] = useState(varied[1]!);
  const over = [across, up].map((name) => `over=${encodeURIComponent(name)}`).join("&");
  const { url, error } = usePicture(`${path}?format=png&${over}&standard=r157#${edition}`);
  return (
    <div class="card">
      <h3>Over two parameters</h3>
      <div class="row">
        {[
          { label: "Across", value: across, choose: setAcross },
          { label: "Up", value: up, choose: setUp },
        ].map(({ label, value, choose }) => (
          <label key={label}>
            {label}{" "}
            <select value={value} onChange={(event) => choose(event.currentTarget.value)}>
              {varied.map((name) => (
                <option key={name}>{name}</option>
              ))}
            </select>
          </label>
        ))}
      </div>
      <figure class="picture">
        <div class="paper">
          {url ? <img src={url} alt={`Verdicts over ${across} and ${up}`} /> : <span class="faint">{error ?? "Loading …"}</span>}
        </div>
      </figure>
    </div>
  );
}
