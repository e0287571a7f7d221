/** How many known defects the budget of a campaign detects, each method by its own. */

import { useAsked } from "../../api/asked";
import { ended } from "../../api/ended";
import type { Body } from "../../api/types";

const ASK_MS = 30_000; // steps are estimated by the episodes so far

export function Worth({ campaign }: { campaign: Body<"Campaign"> }) {
  const path = `v1/campaigns/${encodeURIComponent(campaign.id)}/power`;
  const { value } = useAsked<Body<"Power">>(path, () => (ended(campaign) ? null : ASK_MS));
  if (!value) return null;
  return (
    <section class="card" aria-labelledby="worth-title">
      <h2 id="worth-title" title={value.note}>
        {campaign.progress.failures ? "Known defects that this budget detects" : "What finding nothing is worth"}
      </h2>
      {value.methods.length === 0 && <p>{value.note}</p>}
      {value.methods.map(({ method, sentences }) => (
        <p key={method} title={sentences.slice(1).join(" ")}>
          <b>{method}</b>: {sentences[0]}
        </p>
      ))}
    </section>
  );
}
