/** The funnel of each requirement, as a table: violated -> valid -> distinct -> preventable -> published, and its rate. */

import type { ComponentChildren } from "preact";
import type { Body } from "../api/types";
import { address } from "../router";
import { capital, count, percent, words } from "./text";
import "./requirements.css";

export type Requirements = Record<string, Body<"RequirementCounts">>;

const COLUMNS = [
  ["violated", "Episodes in which it was violated after the adversaries' release"],
  ["valid", "Of these, failures: it counts, and no rule refused the violation"],
  ["distinct", "Kinds of these, each once in a run"],
  ["preventable", "Kinds that a reference driver would have prevented"],
  ["published", "Of these, kinds that R157, FSM or RSS would have prevented"],
] as const;

/** Those that count first. */
export function byWeight(requirements: Requirements): [string, Requirements[string]][] {
  return Object.entries(requirements).sort(([, a], [, b]) => Number(b.counts === "failure") - Number(a.counts === "failure"));
}

interface Props {
  requirements: Requirements;
  /** What they belong to, for screen readers. */
  of: string;
  /** Where the failures are listed; without it, no name is a link. */
  campaign?: string;
}

export function RequirementTable({ requirements, of, campaign }: Props) {
  const rows = byWeight(requirements);
  if (!rows.length) return null;
  return (
    <div class="scroll" tabIndex={0} role="region" aria-label={`Requirements of ${of}`}>
      <table class="requirements">
        <thead>
          <tr>
            <th scope="col">Requirement</th>
            <th scope="col">Counts as</th>
            {COLUMNS.map(([name, meaning]) => (
              <th key={name} scope="col" class="number" title={meaning}>
                {capital(name)}
              </th>
            ))}
            <th scope="col" class="number" title="Failures per episode; of a requirement that is only reported, violations per episode">
              Rate <span class="faint">and its 95 % interval</span>
            </th>
          </tr>
        </thead>
        <tbody>
          {rows.map(([name, row]) => (
            <tr key={name} data-requirement={name} data-counts={row.counts}>
              <th scope="row">
                <Linked to={campaign && row.valid ? address(["campaigns", campaign, "failures"], { requirement: name }) : undefined}>{words(name)}</Linked>
              </th>
              <td>{row.counts === "failure" ? "a failure" : "reported only"}</td>
              {COLUMNS.map(([step]) => (
                <td key={step} class="number" data-step={step}>
                  {row.counts === "failure" || step === "violated" ? count(row[step]) : "–"}
                </td>
              ))}
              <td class="number rate-cell">
                {percent(row.rate)} <span class="faint">{bracketOf(row)}</span>
              </td>
            </tr>
          ))}
        </tbody>
      </table>
    </div>
  );
}

function Linked({ to, children }: { to: string | undefined; children: ComponentChildren }) {
  return to === undefined ? <>{children}</> : <a href={to}>{children}</a>;
}

export function bracketOf({ rate_low, rate_high }: Requirements[string]): string {
  return rate_low === null || rate_high === null ? "" : `[${(100 * rate_low).toFixed(1)}, ${(100 * rate_high).toFixed(1)}]`;
}
