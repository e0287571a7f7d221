/** Requirements against methods, or campaigns: how often each is violated, and what came of it. */

import { count, words } from "../../ui/text";
import { bracketOf, byWeight, type Requirements } from "../../ui/requirements";
import { percent, type Row } from "./rows";

export function ByRequirement({ what, family, rows }: { what: string; family: string; rows: Row[] }) {
  const requirements: Requirements = Object.assign({}, ...rows.map((row) => row.requirements));
  const names = byWeight(requirements).map(([name]) => name);
  if (!names.length) return null;
  return (
    <section class="block">
      <h3>By requirement</h3>
      <p class="faint small">Failures per episode with their 95 % interval, and failures → distinct → preventable; of what is only reported, violations per episode.</p>
      <div class="scroll" tabIndex={0} role="region" aria-label={`Requirements by ${what.toLowerCase()}: ${family}`}>
        <table class="by-requirement">
          <thead>
            <tr>
              <th scope="col">Requirement</th>
              {rows.map((row) => (
                <th key={row.key} scope="col" class="number">
                  {row.name}
                </th>
              ))}
            </tr>
          </thead>
          <tbody>
            {names.map((name) => (
              <tr key={name} data-requirement={name}>
                <th scope="row">{words(name)}</th>
                {rows.map((row) => (
                  <Cell key={row.key} found={row.requirements[name]} />
                ))}
              </tr>
            ))}
          </tbody>
        </table>
      </div>
    </section>
  );
}

function Cell({ found }: { found: Requirements[string] | undefined }) {
  if (!found) return <td class="number faint">–</td>;
  return (
    <td class="number">
      <b>{percent(found.rate)}</b> <span class="faint">{bracketOf(found)}</span>
      <br />
      <span class="faint small">
        {found.counts === "failure" ? [found.valid, found.distinct, found.preventable].map(count).join(" → ") : `${count(found.violated)}, reported only`}
      </span>
    </td>
  );
}
