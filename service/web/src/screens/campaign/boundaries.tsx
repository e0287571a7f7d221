/** The boundary of the ego in each run of the method `boundary` that has succeeded. */

import { useAsked } from "../../api/asked";
import type { Body } from "../../api/types";
import { usePicture } from "../../ui/picture";
import { Failed, Loading } from "../../ui/states";

type Found = Body<"BoundaryMap">;
type BoxShare = Body<"BoxShare">;

const DRIVERS: Record<string, string> = { ego: "the ego", r157: "R157's driver", fsm: "FSM" };

export function Boundaries({ campaign }: { campaign: Body<"Campaign"> }) {
  const runs = campaign.runs.filter((run) => run.method === "boundary" && run.state === "succeeded");
  return (
    <>
      {runs.map((run) => (
        <Boundary key={run.id} campaign={campaign.id} run={run} />
      ))}
    </>
  );
}

function Boundary({ campaign, run }: { campaign: string; run: Body<"Run"> }) {
  const path = `v1/campaigns/${encodeURIComponent(campaign)}/runs/${encodeURIComponent(run.id)}/boundary`;
  const { value, error } = useAsked<Found>(path);
  const picture = usePicture(`${path}.png`);
  return (
    <section class="card boundary" aria-label={`Boundary of ${run.id}`}>
      <h2>
        Boundary <span class="faint">{run.id}</span>
      </h2>
      {error ? <Failed error={error} /> : !value && <Loading what="the boundary" />}
      {value && <Drivers map={value} />}
      {value?.notes.map((note) => (
        <p key={note} class="small">
          {note}
        </p>
      ))}
      {picture.error && <p class="small">{picture.error}</p>}
      {picture.url && <img src={picture.url} alt={`Where the ego of ${run.id} passes and fails, with the drivers' boundaries`} />}
    </section>
  );
}

function Drivers({ map }: { map: Found }) {
  return (
    <div class="boundary-drivers">
      <table>
        <thead>
          <tr>
            <th scope="col">driver</th>
            <th scope="col">fails in (95 %)</th>
            <th scope="col">the ego fails, it does not (95 %)</th>
          </tr>
        </thead>
        <tbody>
          {map.maps.map((driver) => (
            <tr key={driver.name}>
              <th scope="row">{DRIVERS[driver.name] ?? driver.name}</th>
              <td>{words(driver.fails)}</td>
              <td>{driver.ego_fails_alone ? words(driver.ego_fails_alone) : ""}</td>
            </tr>
          ))}
        </tbody>
      </table>
    </div>
  );
}

function words({ share, low, high }: BoxShare): string {
  return `${percent(share)} (${percent(low)} to ${percent(high)})`;
}

function percent(share: number): string {
  return `${Math.round(100 * share)} %`;
}
