/** Failures as they are found. */

import { address } from "../../router";
import { words } from "../../ui/text";
import type { Found } from "./live";

export function Newest({ campaign, found }: { campaign: string; found: Found[] }) {
  return (
    <section class="card newest" aria-labelledby="newest-title">
      <h2 id="newest-title">Newest failures</h2>
      {found.length === 0 && <p class="faint small">None yet. Each valid one shows here as soon as it is found.</p>}
      <ol>
        {found.map((failure) => (
          <li key={failure.id}>
            <a href={address(["campaigns", campaign, "failures", failure.id])}>{described(failure)}</a>
            <span class="faint small">
              {failure.run_id}, episode {failure.index + 1}
            </span>
          </li>
        ))}
      </ol>
    </section>
  );
}

function described({ collision }: Found): string {
  if (!collision) return "failure";
  const kind = collision.judgement?.signature.split(";")[0] ?? words(collision.other_kind);
  const closing = collision.relative_speed_mps === null ? "" : `${Math.round(3.6 * collision.relative_speed_mps)} km/h`;
  return [kind, closing, collision.judgement?.grade].filter(Boolean).join(", ");
}
