/** Headline kinds by version: new, found again, gone, returned. */

import { address } from "../../router";
import { kindsOf, nameOf, type Row } from "./points";

export function KindsTable({ row }: { row: Row }) {
  const kinds = kindsOf(row);
  if (kinds.length === 0) return null;
  return (
    <section class="card" aria-labelledby="kinds">
      <h2 id="kinds">Headline kinds by version</h2>
      <div class="scroll" tabIndex={0} role="region" aria-label="Kinds and versions">
        <table class="kinds-by-version">
          <thead>
            <tr>
              <th scope="col">Kind</th>
              {row.points.map((point) => (
                <th key={point.campaign_id} scope="col" class={point.changed.length ? "after-break" : undefined}>
                  <a href={address(["campaigns", point.campaign_id, "failures"])}>{nameOf(point)}</a>
                </th>
              ))}
            </tr>
          </thead>
          <tbody>
            {kinds.map(([name, changes]) => (
              <tr key={name}>
                <th scope="row">{name}</th>
                {changes.map((change, at) => (
                  <td key={row.points[at]!.campaign_id} data-change={change} class={row.points[at]!.changed.length ? "after-break" : undefined}>
                    {change === "absent" ? <span class="faint">–</span> : change}
                  </td>
                ))}
              </tr>
            ))}
          </tbody>
        </table>
      </div>
    </section>
  );
}
