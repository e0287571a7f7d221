/** What a campaign is, how far it is, and what can be done with it. */

import { useState } from "preact/hooks";
import { absolute, download, hasKey, send } from "../../api/client";
import { ended } from "../../api/ended";
import type { Body } from "../../api/types";
import { address, go } from "../../router";
import { ScenarioNames } from "../../ui/scenario";
import { count, egoWords, moment, seconds } from "../../ui/text";
import { TagsEditor } from "../../ui/tags";
import { Confirm } from "../../ui/confirm";

type Campaign = Body<"Campaign">;

export function Header({ campaign, again }: { campaign: Campaign; again: () => void }) {
  const { spec, state } = campaign;
  const title = campaign.label || campaign.id;
  return (
    <>
      <div class="head">
        <p class="crumbs">
          <a href="#/campaigns">Campaigns</a> / {title}
        </p>
        <h1 title={title}>{title}</h1>
        <span class={`tag ${state}`}>{state}</span>
        <Actions campaign={campaign} again={again} />
      </div>
      {campaign.reason && <p class="bad breaking">{campaign.reason}</p>}
      <dl class="posted">
        <Fact name={spec.families.length > 1 ? "Families" : "Family"}>
          <ScenarioNames names={spec.families} />
        </Fact>
        <Fact name={spec.methods.length > 1 ? "Methods" : "Method"}>{spec.methods.join(", ")}</Fact>
        <Fact name="Ego">{egoWords(campaign.ego)}</Fact>
        <Fact name="Behaviour">{spec.odd?.dynamic?.behaviour ?? "ordinary"}</Fact>
        <Fact name={spec.seeds.length > 1 ? "Seeds" : "Seed"}>{spec.seeds.join(", ")}</Fact>
        <Fact name="Posted">{moment(campaign.created_at)}</Fact>
        <Fact name="Tags">
          <TagsEditor id={campaign.id} tags={campaign.tags} again={again} />
        </Fact>
      </dl>
      <Advance campaign={campaign} />
    </>
  );
}

function Fact({ name, children }: { name: string; children: preact.ComponentChildren }) {
  return (
    <div>
      <dt>{name}</dt>
      <dd>{children}</dd>
    </div>
  );
}

function Advance({ campaign }: { campaign: Campaign }) {
  const { episodes_done: done, episodes_total: total, eta_s } = campaign.progress;
  const started = campaign.started_at && new Date(campaign.started_at).getTime();
  const finished = campaign.finished_at && new Date(campaign.finished_at).getTime();
  const took = started && finished ? `took ${seconds((finished - started) / 1000)}` : "";
  const left = eta_s === null ? "time left not known yet" : `${seconds(eta_s)} left`;
  return (
    <div class="advance">
      <div class="progress" role="progressbar" aria-label="Episodes done" aria-valuemin={0} aria-valuemax={total} aria-valuenow={done}>
        <span style={{ width: `${total ? (100 * done) / total : 0}%` }} />
      </div>
      <span class="small">
        <b data-field="done">{count(done)}</b> of {count(total)} episodes
        <span class="faint"> · {ended(campaign) ? took || "ended" : left}</span>
      </span>
    </div>
  );
}

function Actions({ campaign, again }: { campaign: Campaign; again: () => void }) {
  const [asking, setAsking] = useState<"cancel" | "delete">();
  const [refused, setRefused] = useState("");
  const path = `v1/campaigns/${encodeURIComponent(campaign.id)}`;
  const save = (from: string, suffix: string) => {
    setRefused("");
    download(from, `${campaign.id}.${suffix}`).catch((error: Error) => setRefused(error.message));
  };
  const report = `${path}/report?format=html`;
  const keyed = (event: Event) => {
    if (!hasKey()) return; // a link cannot carry the key, a call can
    event.preventDefault();
    save(report, "html");
  };
  return (
    <div class="actions">
      <a class="button primary" href={address(["campaigns", campaign.id, "failures"])}>
        Failures
      </a>
      <a class="button" href={address(["campaigns", campaign.id, "compare"])}>
        Compare methods
      </a>
      <a class="button" href={address(["campaigns", campaign.id, "coverage"])}>
        Coverage
      </a>
      <a class="button" href={absolute(report)} target="_blank" rel="noopener" onClick={keyed}>
        Report
      </a>
      <a class="button" href={address(["new"], { from: campaign.id })}>
        Clone
      </a>
      <span class="joined" role="group" aria-label="Download what was posted">
        <button onClick={() => save(`${path}/spec?format=json`, "json")}>Spec JSON</button>
        <button onClick={() => save(`${path}/spec?format=yaml`, "yaml")}>YAML</button>
      </span>
      <button title="All episodes so far, as a Parquet table" onClick={() => save(`${path}/export?format=parquet`, "parquet")}>
        Episodes
      </button>
      {ended(campaign) ? (
        <button class="danger" onClick={() => setAsking("delete")}>
          Delete
        </button>
      ) : (
        <button class="danger" onClick={() => setAsking("cancel")} disabled={campaign.state === "cancelling"}>
          Cancel
        </button>
      )}
      {refused && <span role="alert" class="bad">{refused}</span>}
      {asking === "cancel" && (
        <Confirm title="Cancel this campaign?" verb="Cancel the campaign" act={async () => { await send("POST", `${path}/cancel`); again(); }} close={() => setAsking(undefined)}>
          <p>
            Its runs stop after their current episode. What was found stays. A cancelled campaign cannot go on, but it can be cloned.
          </p>
        </Confirm>
      )}
      {asking === "delete" && (
        <Confirm title="Delete this campaign?" verb="Delete for good" act={async () => { await send("DELETE", path); go("#/campaigns"); }} close={() => setAsking(undefined)}>
          <p>
            All that it found goes with it: {count(campaign.progress.failures)} recorded failures, figures and logs. This cannot be undone.
          </p>
        </Confirm>
      )}
    </div>
  );
}
