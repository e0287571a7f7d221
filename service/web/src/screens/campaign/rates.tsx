/** How often the ego fails under the declared distributions, in each run of the method `rate` that has succeeded. */

import { useState } from "preact/hooks";
import { useAsked } from "../../api/asked";
import type { Body } from "../../api/types";
import { Failed, Loading } from "../../ui/states";
import { count, words } from "../../ui/text";
import { shared, small, within } from "./rate_words";

type Found = Body<"CampaignRates">;
type Run = Found["items"][number];

export function RatesOfCampaign({ campaign }: { campaign: Body<"Campaign"> }) {
  const runs = campaign.runs.filter((run) => run.method === "rate" && run.state === "succeeded");
  return runs.length > 0 ? <RateCard key={runs.length} campaign={campaign.id} /> : null; // asked again as each ends
}

function RateCard({ campaign }: { campaign: string }) {
  const [exposure, setExposure] = useState("");
  const hourly = Number(exposure) > 0 ? `?exposure=${Number(exposure)}` : "";
  const { value, error } = useAsked<Found>(`v1/campaigns/${encodeURIComponent(campaign)}/rates${hourly}`);
  return (
    <section class="card failure-rates" aria-labelledby="rates-title">
      <h2 id="rates-title">Failure rates</h2>
      <label class="small">
        Scenes of this scenario in an hour of driving:{" "}
        <input type="number" min="0" step="any" value={exposure} placeholder="not stated" onInput={(event) => setExposure(event.currentTarget.value)} />
      </label>
      {error ? <Failed error={error} /> : !value && <Loading what="the rates" />}
      {value?.items.map((run) => (
        <RateTable key={run.run_id} run={run} />
      ))}
      {value && <p class="small faint">{value.items[0]?.meaning}</p>}
    </section>
  );
}

function RateTable({ run }: { run: Run }) {
  const rows = Object.entries(run.rates);
  const hourly = run.scenes_per_hour !== null;
  return (
    <>
      <p class="small">
        {run.run_id}: {count(run.played)} of {count(run.draws)} draws played. Scenes: {shared(run.distributions)}
      </p>
      <div class="scroll" tabIndex={0} role="region" aria-label={`Failure rates of ${run.run_id}`}>
        <table>
          <thead>
            <tr>
              <th scope="col">Requirement</th>
              <th scope="col" class="number">Failures</th>
              <th scope="col" class="number">Rate in a scene</th>
              <th scope="col">95 % interval</th>
              {hourly && <th scope="col">In an hour</th>}
            </tr>
          </thead>
          <tbody>
            {rows.map(([name, estimate]) => (
              <tr key={name} data-rate={name}>
                <th scope="row">{name === "failure" ? "any that counts" : words(name)}</th>
                <td class="number">{count(estimate.failures)}</td>
                {estimate.rate === null ? (
                  <td colSpan={hourly ? 3 : 2} class="why">
                    not estimated: {estimate.why}; at most {small(estimate.at_most)} <span class="faint">(95 %)</span>
                  </td>
                ) : (
                  <>
                    <td class="number">{small(estimate.rate)}</td>
                    <td>{within(estimate)}</td>
                    {hourly && <td>{estimate.per_hour ? `${small(estimate.per_hour.rate)} (${within(estimate.per_hour)})` : "–"}</td>}
                  </>
                )}
              </tr>
            ))}
          </tbody>
        </table>
      </div>
    </>
  );
}
