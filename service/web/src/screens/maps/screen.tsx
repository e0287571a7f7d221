/** The maps that were uploaded, and a form for another one. */

import { useState } from "preact/hooks";
import { useAsked } from "../../api/asked";
import { send } from "../../api/client";
import type { Body } from "../../api/types";
import { address } from "../../router";
import { Confirm } from "../../ui/confirm";
import { Empty, Shown } from "../../ui/states";
import { count, moment } from "../../ui/text";
import { useTitle } from "../../ui/title";
import { Upload } from "./upload";
import "./maps.css";

type Network = Body<"Network">;

export function MapsScreen() {
  useTitle("Maps");
  const asked = useAsked<Body<"NetworkPage">>("v1/networks?limit=500"); // a project has 200 at most
  const [doubt, setDoubt] = useState<Network>();
  return (
    <div class="maps grid">
      <div class="head">
        <h1>Maps</h1>
        <span class="faint">Run campaigns on your own roads.</span>
      </div>
      <Upload />
      <Shown asked={asked} what="the maps">
        {({ items }) => (items.length === 0 ? <Empty>There is no map yet.</Empty> : <Table maps={items} remove={setDoubt} />)}
      </Shown>
      {doubt && (
        <Confirm
          title={`Delete ${nameOf(doubt)}?`}
          verb="Delete for good"
          act={async () => void (await send("DELETE", `v1/networks/${doubt.id}`).finally(asked.again))}
          close={() => setDoubt(undefined)}
        >
          <p>The map goes. Campaigns that were run on it keep the piece of it that they need.</p>
        </Confirm>
      )}
    </div>
  );
}

function Table({ maps, remove }: { maps: readonly Network[]; remove: (map: Network) => void }) {
  return (
    <div class="scroll card maps-list" tabIndex={0} role="region" aria-label="Maps">
      <table>
        <thead>
          <tr>
            <th>Map</th>
            <th class="number">Roads</th>
            <th class="number">Length</th>
            <th class="number">Warnings</th>
            <th>Added</th>
            <th>
              <span class="hidden-label">What can be done</span>
            </th>
          </tr>
        </thead>
        <tbody>
          {maps.map((map) => (
            <tr key={map.id}>
              <td class="breaking">
                <a href={address(["maps", map.id])} title={nameOf(map)}>
                  {nameOf(map)}
                </a>
              </td>
              <td class="number">{count(map.edges)}</td>
              <td class="number">{(map.length_m / 1000).toFixed(1)} km</td>
              <td class="number">{count(map.warnings.length)}</td>
              <td>{moment(map.created_at)}</td>
              <td>
                <button class="danger" aria-label={`Delete ${nameOf(map)}`} onClick={() => remove(map)}>
                  Delete
                </button>
              </td>
            </tr>
          ))}
        </tbody>
      </table>
    </div>
  );
}

export function nameOf(map: Network): string {
  return map.label || map.id;
}
