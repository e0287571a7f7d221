/** A card for each run, with the tail of its worker's log on request. */

import { useEffect, useRef, useState } from "preact/hooks";
import { call } from "../../api/client";
import { usePolled } from "../../api/polled";
import type { Body } from "../../api/types";
import { drivenSummary } from "../../ui/driven";
import { count, number, seconds } from "../../ui/text";
import { markOf, runName } from "./look";
import { Sample } from "./sample";

type Run = Body<"Run">;

interface Cards {
  campaign: Body<"Campaign">;
  hidden: ReadonlySet<string>;
  hide: (runs: string[], away: boolean) => void;
}

export function Runs({ campaign, hidden, hide }: Cards) {
  return (
    <section aria-labelledby="runs-title">
      <h2 id="runs-title">
        Runs <span class="faint">({campaign.runs.length})</span>
      </h2>
      <div class="run-cards">
        {campaign.runs.map((run) => (
          <Card key={run.id} run={run} campaign={campaign} away={hidden.has(run.id)} hide={(away) => hide([run.id], away)} />
        ))}
      </div>
    </section>
  );
}

function Card({ run, campaign, away, hide }: { run: Run; campaign: Body<"Campaign">; away: boolean; hide: (away: boolean) => void }) {
  const name = runName(campaign.spec, run);
  return (
    <article class={`card run ${away ? "run-away" : ""}`} aria-label={name} data-run={run.id}>
      <header>
        <Sample mark={markOf(campaign.spec, run)} />
        <h3>{name}</h3>
        <span class={`tag ${run.state}`}>{run.state}</span>
        <button class="quiet" aria-pressed={away} onClick={() => hide(!away)} title="In the curves">
          {away ? "Hidden" : "Hide"}
        </button>
      </header>
      <div class="progress" role="progressbar" aria-label={`Episodes of ${name}`} aria-valuemin={0} aria-valuemax={run.episodes_total} aria-valuenow={run.episodes_done}>
        <span style={{ width: `${run.episodes_total ? (100 * run.episodes_done) / run.episodes_total : 0}%` }} />
      </div>
      <p class="small faint run-line">
        <span>
          {count(run.episodes_done)} of {count(run.episodes_total)} episodes
        </span>
        <span>{time(run)}</span>
      </p>
      <dl class="run-figures">
        <Figure name="headline" value={known(run.metrics?.headline)} />
        <Figure name="failures" value={count(run.failures)} />
        <Figure name="distinct" value={count(run.distinct_failures)} />
        <Figure name="preventable" value={`${count(run.distinct_preventable)} (${count(run.distinct_published)})`} />
        <Figure name="ECR" value={run.metrics ? `${number(100 * (run.metrics.ecr ?? NaN), 1)} %` : "–"} />
        <Figure name="PCR" value={run.metrics ? `${number(100 * (run.metrics.pcr ?? NaN), 1)} %` : "–"} />
      </dl>
      <p class="small faint">
        {count(run.raw_collisions)} contact{run.raw_collisions === 1 ? "" : "s"}, {count(run.rejected)} rejected scene{run.rejected === 1 ? "" : "s"}
        {(run.processes ?? 1) > 1 && <span> · {run.processes} processes</span>}
        {run.attempts > 1 && <span class="warn"> · attempt {run.attempts}</span>}
      </p>
      {run.metrics && Object.keys(run.metrics.episodes_driven_by).length > 0 && <p class="small faint">{drivenSummary(run.metrics.episodes_driven_by)}</p>}
      {run.reason && <p class="small bad breaking">{run.reason}</p>}
      <Log campaign={campaign.id} run={run} name={name} />
    </article>
  );
}

function known(value: number | null | undefined): string {
  return value === null || value === undefined ? "–" : count(value);
}

function Figure({ name, value }: { name: string; value: string }) {
  return (
    <div>
      <dt>{name}</dt>
      <dd>{value}</dd>
    </div>
  );
}

function time(run: Run): string {
  if (run.started_at === null) return run.state === "queued" ? "waits for a worker" : "";
  if (run.finished_at === null) return "at work";
  return seconds((new Date(run.finished_at).getTime() - new Date(run.started_at).getTime()) / 1000);
}

const AGAIN_MS = 2000;

function Log({ campaign, run, name }: { campaign: string; run: Run; name: string }) {
  const [open, setOpen] = useState(false);
  return (
    <details onToggle={(event) => setOpen(event.currentTarget.open)}>
      <summary>Log</summary>
      {open && <Tail path={`v1/campaigns/${campaign}/runs/${run.id}/log?lines=200`} going={run.state === "running"} name={name} />}
    </details>
  );
}

function Tail({ path, going, name }: { path: string; going: boolean; name: string }) {
  const box = useRef<HTMLPreElement>(null);
  const [text, setText] = useState<string>();
  const [refused, setRefused] = useState("");
  usePolled(`${path} ${going}`, async (left) => {
    try {
      setText(await (await call(path, { signal: left })).text());
      setRefused("");
    } catch (error) {
      if (left.aborted) return null;
      setRefused(error instanceof TypeError ? "The service does not answer." : (error as Error).message);
    }
    return going ? AGAIN_MS : null;
  });
  useEffect(() => {
    if (box.current) box.current.scrollTop = box.current.scrollHeight; // the newest line
  }, [text]);
  if (text === undefined) return <p class="small faint">{refused || "Loading …"}</p>;
  return (
    <>
      {refused && <p class="small bad">{refused}</p>}
      <pre ref={box} class="log" tabIndex={0} role="region" aria-label={`Log of ${name}`}>
        {text.trim() || "It has printed nothing."}
      </pre>
    </>
  );
}
