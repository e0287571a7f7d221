/** Methods, or campaigns, against each other: first what is worth a person's time, the rest on request. */

import { count, number } from "../../ui/text";
import { Funnel } from "../campaign/funnel";
import { Sample } from "../campaign/sample";
import { Interval } from "./interval";
import { bracket, percent, type Estimate, type Row } from "./rows";
import { niceEnd } from "./scale";

interface Compared {
  /** What the rows are: "Method". */
  what: string;
  family: string;
  rows: Row[];
}

export function Methods({ what, family, rows }: Compared) {
  const ends = { ecr: end(rows.map((row) => row.ecr)), pcr: end(rows.map((row) => row.pcr)) };
  const most = Math.max(1, ...rows.map((row) => row.distinct_failures));
  return (
    <div class="scroll" tabIndex={0} role="region" aria-label={`${what}s compared: ${family}`}>
      <table class="methods">
        <thead>
          <tr>
            <th scope="col">{what}</th>
            <th scope="col" title="kinds of failures that are preventable, plausible, not minor, and the same when replayed; in brackets those that R157, FSM or RSS would have prevented">
              Headline
            </th>
            <th scope="col" title="kinds of failures, each once in a run">Distinct</th>
            <th scope="col" title="kinds that a reference driver would have prevented; in brackets those that R157, FSM or RSS would have prevented">Preventable</th>
            <Axis name="ECR" end={ends.ecr} />
            <Axis name="PCR" end={ends.pcr} />
            <th scope="col" class="number">Runs</th>
            <th scope="col" class="number">Episodes</th>
          </tr>
        </thead>
        <tbody>
          {rows.map((row) => (
            <tr key={row.key} data-row={row.key}>
              <th scope="row">
                <Sample mark={row.mark} /> {row.name}
              </th>
              <Bar value={row.headline} most={most} published={row.headline_published ?? 0} />
              <Bar value={row.distinct_failures} most={most} />
              <Bar value={row.distinct_preventable} most={most} published={row.distinct_published} />
              <Rate name="ECR" row={row} estimate={row.ecr} end={ends.ecr} />
              <Rate name="PCR" row={row} estimate={row.pcr} end={ends.pcr} />
              <td class="number">{row.runs}</td>
              <td class="number">{count(row.episodes)}</td>
            </tr>
          ))}
        </tbody>
      </table>
    </div>
  );
}

function Axis({ name, end }: { name: string; end: number }) {
  return (
    <th scope="col" class="rate">
      {name} <span class="faint">and its 95 % interval</span>
      <span class="axis" aria-hidden="true">
        <span>0</span>
        <span>{Number((100 * end).toPrecision(3))} %</span>
      </span>
    </th>
  );
}

function Rate({ name, row, estimate, end }: { name: string; row: Row; estimate: Estimate; end: number }) {
  const text = `${percent(estimate.mean)} ${bracket(estimate)}`;
  return (
    <td class="rate">
      <span class="rate-text">
        <b>{percent(estimate.mean)}</b> <span class="faint">{bracket(estimate)}</span>
      </span>
      <Interval estimate={estimate} from={0} to={end} mark={row.mark} label={`${name} of ${row.name}: ${text}`} />
    </td>
  );
}

/** @param published how many of them R157, FSM or RSS would have prevented. */
function Bar({ value, most, published }: { value: number | null; most: number; published?: number }) {
  return (
    <td class="bar-cell">
      <b>{value === null ? "–" : count(value)}</b>
      {value !== null && published !== undefined && <span class="faint"> ({count(published)})</span>}
      <span class="bar-room">
        <span style={{ width: `${(100 * (value ?? 0)) / most}%` }} />
      </span>
    </td>
  );
}

function end(estimates: Estimate[]): number {
  const most = Math.max(0, ...estimates.map(({ mean, high }) => Math.max(mean ?? 0, high ?? 0)));
  return most ? niceEnd(most) : 0.01;
}

export function Funnels({ rows }: { rows: Row[] }) {
  const most = Math.max(1, ...rows.map((row) => Math.max(row.failures, row.distinct_failures)));
  return (
    <div class="funnels">
      {rows.map((row) => (
        <div key={row.key} role="group" aria-label={`Funnel of ${row.name}`}>
          <h3>
            <Sample mark={row.mark} /> {row.name}
          </h3>
          <Funnel counts={row} most={most} />
        </div>
      ))}
    </div>
  );
}

/** Each measure with what it means. */
const MEASURES: [string, string, (row: Row) => string][] = [
  ["ES", "efficiency: 1 − mean steps to the valid contact / horizon", (row) => measured(row.more.efficiency)],
  ["ρ̄_c", "mean realism cost per step; lower is more realistic", (row) => measured(row.more.cost_rate)],
  ["OFD", "mean distance between two valid contacts, 0 to 1", (row) => measured(row.more.dispersion)],
  ["steps / distinct", "environment steps per distinct failure", (row) => whole(row.more.steps_per_distinct_failure)],
  ["CPU s / distinct", "processor seconds per distinct failure", (row) => number(row.more.cpu_s_per_distinct_failure, 1)],
  ["preventable, repeats too", "failures that a reference driver would have prevented", (row) => count(row.more.preventable)],
  ["contacts", "episodes in which the ego touched something", (row) => count(row.raw_collisions)],
  ["artefacts", "contacts that the simulator or the control made", (row) => count(row.more.artefacts)],
  ["unresponsive", "valid contacts with a visible collision course of 1.5 s in which the ego never braked", (row) => percent(row.more.unresponsive_share)],
  ["rejected scenes", "infeasible scenes", (row) => count(row.rejected)],
  ["steps", "environment steps", (row) => count(row.more.environment_steps)],
];

export function Measures({ what, family, rows }: Compared) {
  const known = MEASURES.filter(([, , value]) => rows.some((row) => value(row) !== "–"));
  return (
    <details>
      <summary>More measures</summary>
      <div class="scroll" tabIndex={0} role="region" aria-label={`More measures: ${family}`}>
        <table>
          <thead>
            <tr>
              <th scope="col">{what}</th>
              {known.map(([name, meaning]) => (
                <th key={name} scope="col" class="number" title={meaning}>
                  {name}
                </th>
              ))}
            </tr>
          </thead>
          <tbody>
            {rows.map((row) => (
              <tr key={row.key}>
                <th scope="row">{row.name}</th>
                {known.map(([name, , value]) => (
                  <td key={name} class="number">
                    {value(row)}
                  </td>
                ))}
              </tr>
            ))}
          </tbody>
        </table>
      </div>
      <dl class="meanings small">
        {known.map(([name, meaning]) => (
          <div key={name}>
            <dt>{name}</dt>
            <dd>{meaning}</dd>
          </div>
        ))}
      </dl>
    </details>
  );
}

function measured(estimate: Estimate): string {
  return [number(estimate.mean, 3), bracket(estimate, 1, 3)].filter(Boolean).join(" ");
}

function whole(value: number | null): string {
  return value === null ? "–" : count(Math.round(value));
}
