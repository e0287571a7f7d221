/** Which campaigns to compare. */

import { useState } from "preact/hooks";
import { useAsked } from "../../api/asked";
import type { Body } from "../../api/types";
import { address, go } from "../../router";
import { Empty, Shown } from "../../ui/states";
import { count, headlineWords, moment } from "../../ui/text";
import { useTitle } from "../../ui/title";

const MOST = 8; // that can still be told apart

export function Picker({ chosen: first }: { chosen: string[] }) {
  useTitle("Compare");
  const asked = useAsked<Body<"CampaignPage">>("v1/campaigns?limit=100");
  const [chosen, setChosen] = useState<ReadonlySet<string>>(new Set(first));
  const choose = (id: string, yes: boolean) => {
    const after = new Set(chosen);
    yes ? after.add(id) : after.delete(id);
    setChosen(after);
  };
  return (
    <div class="compare">
      <div class="head">
        <h1>Compare</h1>
        <span class="faint">One campaign: its methods against each other. Several: side by side.</span>
        <div class="actions">
          <button
            class="primary"
            disabled={chosen.size === 0 || chosen.size > MOST}
            onClick={() => go(chosen.size === 1 ? address(["campaigns", ...chosen, "compare"]) : address(["compare"], { ids: [...chosen].join(",") }))}
          >
            {chosen.size > MOST ? `At most ${MOST}` : chosen.size > 1 ? `Compare ${chosen.size} campaigns` : "Compare"}
          </button>
        </div>
      </div>
      <Shown asked={asked} what="campaigns">
        {({ items }) =>
          items.length === 0 ? (
            <Empty>
              There is no campaign yet. <a href="#/new">Post one</a>
            </Empty>
          ) : (
            <ul class="card picker">
              {items.map((campaign) => (
                <li key={campaign.id}>
                  <label>
                    <input type="checkbox" checked={chosen.has(campaign.id)} onChange={(event) => choose(campaign.id, event.currentTarget.checked)} />
                    <b class="breaking">{campaign.label || campaign.id}</b>
                    <span class={`tag ${campaign.state}`}>{campaign.state}</span>
                    <span class="faint small">
                      {moment(campaign.created_at)} · {count(campaign.progress.episodes_done)} episodes · {headlineWords(campaign.progress)},{" "}
                      {count(campaign.progress.distinct_failures)} distinct,{" "}
                      {count(campaign.progress.distinct_preventable)} preventable ({count(campaign.progress.distinct_published)} by R157, FSM or RSS)
                    </span>
                  </label>
                </li>
              ))}
            </ul>
          )
        }
      </Shown>
    </div>
  );
}
