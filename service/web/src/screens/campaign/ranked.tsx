/** The failure of a campaign that is most likely and severe. */

import { useAsked } from "../../api/asked";
import { ended } from "../../api/ended";
import type { Body } from "../../api/types";
import { address } from "../../router";
import { kindOf, plausibilityOf, severityOf, worstOf } from "../../ui/violations";

const ASK_MS = 10_000; // while failures may still come

/** A line of the funnel; nothing without a failure. */
export function FirstRanked({ campaign }: { campaign: Body<"Campaign"> }) {
  const path = `v1/campaigns/${encodeURIComponent(campaign.id)}/failures?order=weight&limit=1`;
  const { value } = useAsked<Body<"EpisodePage">>(path, () => (ended(campaign) ? null : ASK_MS));
  const first = value?.items[0];
  const worst = first && worstOf(first);
  if (!worst) return null;
  const judged = [severityOf(worst), plausibilityOf(worst)?.verdict].filter(Boolean).join(", ");
  return (
    <p class="stage-note small" title={MEANING}>
      Most likely and severe: <a href={address(["campaigns", campaign.id, "failures", first.id])}>{kindOf(worst)}</a>
      {judged && ` (${judged})`}
    </p>
  );
}

const MEANING = "By severity times plausibility, times the density of the scene where distributions are declared. The list of failures has this order.";
