/** What each reference driver would have prevented, how bad the contacts are, and which party caused the failures. */

import { DRIVEN_BY } from "../../ui/driven";
import { capital, count } from "../../ui/text";
import { driverWords } from "../../ui/verdicts";
import { bracket, percent, type Row } from "./rows";

const SEVERITIES = ["severe", "moderate", "minor"];
const FAULTS = ["ego", "shared", "other"];

interface Props {
  what: string;
  family: string;
  rows: Row[];
}

export function Verdicts({ what, family, rows }: Props) {
  const drivers = [...new Set(rows.flatMap((row) => Object.keys(row.pcr_by_driver)))];
  const judged = rows.some((row) => sum(row.by_severity) + sum(row.by_fault) > 0);
  const drove = DRIVEN_BY.filter((by) => rows.some((row) => row.episodes_driven_by[by]));
  return (
    <>
      {drivers.length > 0 && (
        <section class="block">
          <h3>PCR by reference driver</h3>
          <p class="faint small">
            Valid contacts that each driver would have prevented, per episode, with their 95 % interval; a dash where it was tried on no contact. Full braking alone makes no contact
            preventable. R157's time-to-collision rule applies to cut-ins only.
          </p>
          <Grid {...{ what, rows }} label={`PCR by reference driver: ${family}`} columns={drivers.map((name) => capital(driverWords(name)))}>
            {(row) => drivers.map((name) => <Pcr key={name} found={row.pcr_by_driver[name]} />)}
          </Grid>
        </section>
      )}
      {judged && (
        <section class="block">
          <h3>Severity and fault</h3>
          <p class="faint small">Valid contacts by severity and failures by fault, with the shares of those that were judged.</p>
          <Grid {...{ what, rows }} label={`Severity and fault: ${family}`} columns={[...SEVERITIES.map(capital), ...FAULTS.map((name) => `Fault: ${name}`)]}>
            {(row) => [...SEVERITIES.map((name) => <Share key={name} of={row.by_severity} name={name} />), ...FAULTS.map((name) => <Share key={name} of={row.by_fault} name={name} />)]}
          </Grid>
        </section>
      )}
      {drove.length > 0 && (
        <section class="block">
          <h3>Driven by</h3>
          <p class="faint small">Episodes by what drove the adversaries, with their shares; headline failures by what drove the first of their kind.</p>
          <Grid {...{ what, rows }} label={`Driven by: ${family}`} columns={[...drove.map(capital), ...drove.map((by) => `Headline: ${by}`)]}>
            {(row) => [...drove.map((by) => <Share key={by} of={row.episodes_driven_by} name={by} />), ...drove.map((by) => <Headline key={`headline ${by}`} row={row} by={by} />)]}
          </Grid>
        </section>
      )}
    </>
  );
}

function Headline({ row, by }: { row: Row; by: string }) {
  return <td class="number">{row.headline === null ? "–" : count(row.headline_driven_by[by] ?? 0)}</td>;
}

interface GridProps {
  what: string;
  rows: Row[];
  label: string;
  columns: string[];
  children: (row: Row) => preact.JSX.Element[];
}

function Grid({ what, rows, label, columns, children }: GridProps) {
  return (
    <div class="scroll" tabIndex={0} role="region" aria-label={label}>
      <table>
        <thead>
          <tr>
            <th scope="col">{what}</th>
            {columns.map((name) => (
              <th key={name} scope="col" class="number">
                {name}
              </th>
            ))}
          </tr>
        </thead>
        <tbody>
          {rows.map((row) => (
            <tr key={row.key} data-of={row.key}>
              <th scope="row">{row.name}</th>
              {children(row)}
            </tr>
          ))}
        </tbody>
      </table>
    </div>
  );
}

function Pcr({ found }: { found: Row["pcr_by_driver"][string] | undefined }) {
  if (!found) return <td class="number faint">–</td>;
  return (
    <td class="number">
      <b>{percent(found.pcr)}</b> <span class="faint">{bracket({ mean: found.pcr, low: found.pcr_low, high: found.pcr_high })}</span>
    </td>
  );
}

function Share({ of, name }: { of: Record<string, number>; name: string }) {
  const [found, judged] = [of[name] ?? 0, sum(of)];
  if (!judged) return <td class="number faint">–</td>;
  return (
    <td class="number">
      {count(found)} <span class="faint">({percent(found / judged, 0)})</span>
    </td>
  );
}

function sum(counts: Record<string, number>): number {
  return Object.values(counts).reduce((total, each) => total + each, 0);
}
