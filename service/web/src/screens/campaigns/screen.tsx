/** All campaigns: which there are, how far they are and what they found. */

import { useState } from "preact/hooks";
import { useAsked } from "../../api/asked";
import { send } from "../../api/client";
import { ended } from "../../api/ended";
import type { Body } from "../../api/types";
import { address, replace } from "../../router";
import { Confirm } from "../../ui/confirm";
import { Empty, Shown } from "../../ui/states";
import { count } from "../../ui/text";
import { useTitle } from "../../ui/title";
import { FilterBar, filtersOf, type Filters } from "./filters";
import { useListed, type Listed } from "./listed";
import { orderOf, sorted, textOf, type Order } from "./order";
import { CampaignTable, nameOf } from "./table";
import "./campaigns.css";

interface Doubt {
  verb: "cancel" | "delete";
  campaigns: readonly Listed[];
}

const LEARNING = ["sac", "sb3", "ddpg"];

export function CampaignsScreen({ query }: { query: URLSearchParams }) {
  useTitle("Campaigns");
  const filters = filtersOf(query);
  const order = orderOf(query.get("sort"));
  const [pages, setPages] = useState(1);
  const listed = useListed(filters, pages);
  const families = useAsked<Body<"Families">>("v1/families").value?.items ?? [];
  const methods = useAsked<Body<"Methods">>("v1/methods").value?.items ?? [];
  const [chosen, setChosen] = useState<ReadonlySet<string>>(new Set());
  const [doubt, setDoubt] = useState<Doubt>();
  const show = (shown: Filters, by: Order) => replace(address(["campaigns"], { ...shown, sort: textOf(by) }));
  return (
    <>
      <div class="head">
        <h1>Campaigns</h1>
        <div class="actions">
          <a class="button primary" href="#/new">
            New campaign
          </a>
        </div>
      </div>
      <FilterBar
        filters={filters}
        families={families.map((family) => family.name)}
        methods={methods.map((method) => method.name)}
        tags={[...new Set(listed.value?.items.flatMap(({ tags }) => tags))].sort()}
        change={(changed) => {
          setPages(1);
          show(changed, order);
        }}
      />
      <Shown asked={listed} what="the campaigns">
        {({ items, more }) =>
          items.length === 0 ? (
            <Nothing filtered={Object.keys(filters).length > 0} />
          ) : (
            <>
              <Choice
                chosen={items.filter((each) => chosen.has(each.id))}
                forget={() => setChosen(new Set())}
                ask={(verb, campaigns) => setDoubt({ verb, campaigns })}
              />
              <CampaignTable
                campaigns={sorted(items, order)}
                learners={methods.filter((method) => LEARNING.includes(method.agent)).map((method) => method.name)}
                order={order}
                filters={{ ...filters, sort: textOf(order) }}
                sort={(by) => show(filters, by)}
                chosen={chosen}
                choose={setChosen}
                ask={(verb, campaigns) => setDoubt({ verb, campaigns })}
              />
              <p class="row campaigns-below small">
                <span class="faint">
                  {count(items.length)} {items.length === 1 ? "campaign" : "campaigns"}
                  {more && ", and there are older ones"}
                </span>
                {more && <button onClick={() => setPages(pages + 1)}>Show more</button>}
              </p>
            </>
          )
        }
      </Shown>
      {doubt && <Doubted {...doubt} close={() => setDoubt(undefined)} done={listed.again} />}
    </>
  );
}

function Nothing({ filtered }: { filtered: boolean }) {
  return (
    <Empty>
      {filtered ? (
        <p>No campaign matches.</p>
      ) : (
        <>
          <h2>No campaign yet</h2>
          <p>A campaign searches for situations in which the ego crashes.</p>
          <a class="button primary" href="#/new">
            Start the first one
          </a>
        </>
      )}
    </Empty>
  );
}

interface Chosen {
  chosen: readonly Listed[];
  forget: () => void;
  ask: (verb: Doubt["verb"], campaigns: readonly Listed[]) => void;
}

/** What can be done with several at once. */
function Choice({ chosen, forget, ask }: Chosen) {
  const over = chosen.filter(ended);
  const active = chosen.filter((each) => !ended(each));
  if (chosen.length === 0) return <p class="small faint campaign-choice">Select several to compare them.</p>;
  return (
    <div class="row campaign-choice" role="group" aria-label="With those selected">
      <b>{count(chosen.length)} selected</b>
      {chosen.length > 1 && (
        <a class="button primary" href={`#/compare?ids=${chosen.map((each) => each.id).join()}`}>
          Compare {count(chosen.length)}
        </a>
      )}
      {active.length > 0 && <button onClick={() => ask("cancel", active)}>Cancel {count(active.length)}</button>}
      {over.length > 0 && (
        <button class="danger" onClick={() => ask("delete", over)}>
          Delete {count(over.length)}
        </button>
      )}
      <button onClick={forget}>Select none</button>
    </div>
  );
}

function Doubted({ verb, campaigns, close, done }: Doubt & { close: () => void; done: () => void }) {
  const [one] = campaigns;
  const what = campaigns.length === 1 ? nameOf(one!) : `${count(campaigns.length)} campaigns`;
  const act = async () => {
    try {
      for (const { id } of campaigns) {
        await (verb === "cancel" ? send("POST", `v1/campaigns/${id}/cancel`) : send("DELETE", `v1/campaigns/${id}`));
      }
    } finally {
      done(); // some of them may be through, whatever became of the rest
    }
  };
  return verb === "cancel" ? (
    <Confirm title={`Cancel ${what}?`} verb="Cancel the search" act={act} close={close}>
      <p>The search ends. What was found so far stays.</p>
    </Confirm>
  ) : (
    <Confirm title={`Delete ${what}?`} verb="Delete for good" act={act} close={close}>
      <p>
        {count(total(campaigns, "episodes_done"))} episodes and {count(total(campaigns, "failures"))} valid failures are deleted,
        with their files. This cannot be undone.
      </p>
    </Confirm>
  );
}

function total(campaigns: readonly Listed[], field: "episodes_done" | "failures"): number {
  return campaigns.reduce((sum, campaign) => sum + campaign.progress[field], 0);
}
