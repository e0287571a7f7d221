/** What runs where, what waits in which order, and what is free. */

import { useAsked } from "../../api/asked";
import type { Body } from "../../api/types";
import { address } from "../../router";
import { Empty, Shown } from "../../ui/states";
import { count, moment, seconds } from "../../ui/text";
import { useTitle } from "../../ui/title";
import { Bar } from "../campaigns/table";
import "./workers.css";

type Workers = Body<"Workers">;
type Scheduled = Workers["at_work"][number] | Workers["waiting"][number];

const AGAIN_MS = 2000;
const SILENT_S = 2; // a heartbeat comes each second

export function WorkersScreen() {
  useTitle("Workers");
  const asked = useAsked<Workers>("v1/workers", () => AGAIN_MS);
  return (
    <div class="grid workers">
      <div class="head">
        <h1>Workers</h1>
        <span class="faint">A slot is a process that plays episodes. Each run has at least one.</span>
      </div>
      <Shown asked={asked} what="the workers">
        {(workers) => (
          <>
            {workers.paused && (
              <p class="card bad breaking" role="alert">
                All runs are paused: {workers.paused}
              </p>
            )}
            <Slots {...workers} />
            <AtWork {...workers} />
            <Queue {...workers} />
          </>
        )}
      </Shown>
    </div>
  );
}

function Slots({ slots, taken, at_work }: Workers) {
  const mine = at_work.reduce((sum, run) => sum + run.slots, 0);
  return (
    <section class="card" aria-label="Slots">
      <div class="tiles">
        <Tile value={slots} name="slots" />
        <Tile value={taken} name="taken" />
        <Tile value={Math.max(0, slots - taken)} name="free" />
        {taken > mine && <Tile value={taken - mine} name="by other projects" />}
      </div>
      {slots === 0 && <p class="bad">No machine is there to execute runs; they wait until one is.</p>}
    </section>
  );
}

function Tile({ value, name }: { value: number; name: string }) {
  return (
    <span class="tile">
      <b>{count(value)}</b>
      <span>{name}</span>
    </span>
  );
}

function AtWork({ at_work: runs }: Workers) {
  const apart = runs.some(({ node }) => node !== null);
  return (
    <section class="card" aria-labelledby="at-work-title">
      <h2 id="at-work-title">At work</h2>
      {runs.length === 0 ? (
        <Empty>No run is at work.</Empty>
      ) : (
        <div class="scroll" tabIndex={0} role="region" aria-label="Runs at work">
          <table>
            <thead>
              <tr>
                <th>Campaign</th>
                <th>Run</th>
                {apart && <th>Machine</th>}
                <th class="number">Slots</th>
                <th>Since</th>
                <th>Last heartbeat</th>
                <th>Episodes</th>
              </tr>
            </thead>
            <tbody>
              {runs.map((run) => (
                <tr key={run.campaign_id + run.run_id}>
                  <Named {...run} />
                  {apart && <td>{run.node ?? "–"}</td>}
                  <td class="number">{count(run.slots)}</td>
                  <td>{moment(run.since)}</td>
                  <td class={(run.silent_s ?? 0) > SILENT_S ? "bad" : undefined}>
                    {run.state === "cancelling" ? "is told to stop" : run.silent_s === null ? "not begun" : `${seconds(run.silent_s)} ago`}
                  </td>
                  <td>
                    <Bar done={run.episodes_done} total={run.episodes_total} name={run.run_id} />
                  </td>
                </tr>
              ))}
            </tbody>
          </table>
        </div>
      )}
    </section>
  );
}

function Queue({ waiting, queued }: Workers) {
  return (
    <section class="card" aria-labelledby="queue-title">
      <h2 id="queue-title">Queue</h2>
      <p class="small faint">
        {queued === 0
          ? "No run waits."
          : `${count(queued)} ${queued === 1 ? "run waits" : "runs wait"}. The project with the fewest slots is served first, then the oldest run.`}
        {queued > waiting.length && ` The first ${count(waiting.length)} of yours are shown.`}
      </p>
      {waiting.length > 0 && (
        <div class="scroll" tabIndex={0} role="region" aria-label="Runs that wait">
          <table>
            <thead>
              <tr>
                <th>Campaign</th>
                <th>Run</th>
                <th class="number">Place</th>
                <th class="number">Episodes</th>
                <th>Remark</th>
              </tr>
            </thead>
            <tbody>
              {waiting.map((run) => (
                <tr key={run.campaign_id + run.run_id}>
                  <Named {...run} />
                  <td class="number">{run.place === null ? "–" : count(run.place)}</td>
                  <td class="number">{count(run.episodes_total)}</td>
                  <td class="breaking">{run.reason ?? ""}</td>
                </tr>
              ))}
            </tbody>
          </table>
        </div>
      )}
    </section>
  );
}

function Named({ campaign_id: id, label, run_id }: Scheduled) {
  return (
    <>
      <td class="breaking">
        <a href={address(["campaigns", id])}>
          <bdi>{label || id}</bdi>
        </a>
      </td>
      <td>{run_id}</td>
    </>
  );
}
