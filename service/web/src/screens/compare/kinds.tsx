/** Which different failures there are, what found them, and one of each to look at. */

import type { Body } from "../../api/types";
import { address } from "../../router";
import { count } from "../../ui/text";
import { GRADE_WORDS, type GradeName } from "../../ui/verdicts";

interface Found {
  campaign: string;
  family: string;
  overview: Body<"Overview">;
  cells: Body<"Cell">[];
}

export function Kinds({ campaign, family, overview, cells }: Found) {
  const most = Math.max(1, ...cells.flatMap((cell) => Object.values(cell.kinds)));
  if (!overview.clusters.length) return <p class="faint">No method has found a valid failure.</p>;
  return (
    <section class="block">
      <h3>
        Kinds of failures <span class="faint">({overview.clusters.length})</span>
      </h3>
      <p class="faint small">
        Effective number of variants (Vendi score): {overview.vendi.toFixed(1)}. The failures lie in {overview.covered} of the taxonomy's {count(overview.cells)} cells.
      </p>
      <div class="scroll" tabIndex={0} role="region" aria-label={`Kinds of failures: ${family}`}>
        <table class="kinds">
          <thead>
            <tr>
              <th scope="col">Kind, with one to look at</th>
              {cells.map((cell) => (
                <th key={cell.method} scope="col" class="number">
                  {cell.method}
                </th>
              ))}
              <th scope="col" class="number">Variants</th>
              <th scope="col" class="number">Preventable</th>
            </tr>
          </thead>
          <tbody>
            {overview.clusters.map((kind) => (
              <tr key={kind.name}>
                <th scope="row">
                  <a href={address(["campaigns", campaign, "failures", kind.representative])}>{kind.name}</a>{" "}
                  {kind.grade && <span class={`tag ${kind.grade}`}>{GRADE_WORDS[kind.grade as GradeName]?.short ?? kind.grade}</span>}
                </th>
                {cells.map((cell) => (
                  <Heat key={cell.method} value={cell.kinds[kind.name] ?? 0} most={most} />
                ))}
                <td class="number">{count(kind.variants)}</td>
                <td class="number">
                  {count(kind.preventable)} <span class="faint" title="that R157, FSM or RSS would have prevented">({count(kind.published)})</span>
                </td>
              </tr>
            ))}
          </tbody>
        </table>
      </div>
    </section>
  );
}

function Heat({ value, most }: { value: number; most: number }) {
  const strength = value ? 10 + (24 * value) / most : 0; // more is too little contrast in the dark theme
  return (
    <td class="number" style={{ background: `color-mix(in srgb, var(--series-6) ${strength}%, transparent)` }}>
      {value ? count(value) : <span class="faint">–</span>}
    </td>
  );
}
