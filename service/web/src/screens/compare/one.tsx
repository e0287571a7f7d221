/** The report of one campaign: its methods against each other, family by family. */

import { useState } from "preact/hooks";
import { useAsked } from "../../api/asked";
import { download } from "../../api/client";
import type { Body } from "../../api/types";
import { address } from "../../router";
import { ScenarioNames } from "../../ui/scenario";
import { Empty, Shown } from "../../ui/states";
import { useTitle } from "../../ui/title";
import { markOf } from "../campaign/look";
import { Figures } from "./figures";
import { Kinds } from "./kinds";
import { Funnels, Measures, Methods } from "./methods";
import { ByRequirement } from "./requirements";
import { rowOfCell } from "./rows";
import { Tests } from "./tests";
import { Verdicts } from "./verdicts";

type Table = Body<"Table">;
type Phase = Body<"Cell">["phase"];

const AGAIN_MS = 15_000; // a report takes longer than a status

export function One({ id }: { id: string }) {
  const path = `v1/campaigns/${encodeURIComponent(id)}`;
  const asked = useAsked<Table>(`${path}/table?format=json`, (table) => (table.complete ? null : AGAIN_MS));
  const [phase, setPhase] = useState<Phase>("search");
  const [refused, setRefused] = useState("");
  const title = asked.value?.spec.label || id;
  useTitle("Methods", title);
  const save = (format: string) => download(`${path}/table?format=${format}`, `${id}.${format}`).then(() => setRefused(""), (error: Error) => setRefused(error.message));
  return (
    <div class="compare">
      <div class="head">
        <p class="crumbs">
          <a href="#/campaigns">Campaigns</a> / <a href={address(["campaigns", id])}>{title}</a> / Compare
        </p>
        <h1 class="breaking">Methods of {title}</h1>
        <div class="actions">
          {asked.value?.cells.some((cell) => cell.phase === "evaluation") && <PhaseChoice phase={phase} choose={setPhase} />}
          <span class="joined" role="group" aria-label="Download the report">
            <button onClick={() => save("csv")}>CSV</button>
            <button onClick={() => save("md")}>Markdown</button>
            <button onClick={() => save("json")}>JSON</button>
          </span>
          <a class="button" href="#/compare">
            Compare campaigns
          </a>
          {refused && <span role="alert" class="bad">{refused}</span>}
        </div>
      </div>
      <Shown asked={asked} what="the report">
        {(table) => (
          <>
            {table.missing.length > 0 && <Missing runs={table.missing} />}
            {table.cells.length === 0 ? (
              <Empty>
                <p>No run has finished; the report covers those that have.</p>
                <a href={address(["campaigns", id])}>To the campaign</a>
              </Empty>
            ) : (
              <Families id={id} table={table} phase={phase} />
            )}
          </>
        )}
      </Shown>
    </div>
  );
}

function PhaseChoice({ phase, choose }: { phase: Phase; choose: (phase: Phase) => void }) {
  return (
    <span class="joined" role="group" aria-label="Episodes of">
      {(["search", "evaluation"] as const).map((each) => (
        <button key={each} aria-pressed={each === phase} onClick={() => choose(each)}>
          {each}
        </button>
      ))}
    </span>
  );
}

function Missing({ runs }: { runs: Body<"MissingRun">[] }) {
  return (
    <details class="card notice">
      <summary>
        {runs.length} {runs.length > 1 ? "runs are" : "run is"} not in this report yet
      </summary>
      <ul>
        {runs.map((run) => (
          <li key={`${run.family} ${run.method} ${run.seed}`} class="breaking">
            {run.family}, {run.method}, seed {run.seed}: {run.reason}
          </li>
        ))}
      </ul>
    </details>
  );
}

function Families({ id, table, phase }: { id: string; table: Table; phase: Phase }) {
  const families = [...new Set(table.cells.map((cell) => cell.family))];
  const [all, setAll] = useState(false);
  return (
    <>
      {families.map((family) => (
        <Family key={family} id={id} table={table} family={family} phase={phase} />
      ))}
      <details class="card" onToggle={(event) => setAll(event.currentTarget.open)}>
        <summary>All figures</summary>
        {all && <Figures campaign={id} />}
      </details>
    </>
  );
}

function Family({ id, table, family, phase }: { id: string; table: Table; family: Body<"Cell">["family"]; phase: Phase }) {
  const cells = table.cells.filter((cell) => cell.family === family && cell.phase === phase);
  const rows = cells.map((cell) => rowOfCell(cell, markOf(table.spec, { family: table.spec.families[0]!, method: cell.method })));
  const tests = table.tests.filter((test) => test.family === family && test.phase === phase);
  const paid = table.paid_tests.filter((test) => test.family === family && test.phase === phase);
  const overview = table.failures[family];
  return (
    <section class="card family" aria-labelledby={`family-${family}`}>
      <h2 id={`family-${family}`}>
        Family <ScenarioNames names={[family]} />
        {phase === "evaluation" && <span class="faint">, the frozen policies</span>}
      </h2>
      <Methods what="Method" family={family} rows={rows} />
      <Funnels rows={rows} />
      <Verdicts what="Method" family={family} rows={rows} />
      <ByRequirement what="Method" family={family} rows={rows} />
      <Measures what="Method" family={family} rows={rows} />
      <Tests tests={paid} family={family} reference={paid[0]?.reference ?? table.reference} caption={`Declared beforehand: ${paid[0]?.metric}`} />
      <Tests tests={tests} family={family} reference={table.reference} caption={`${table.reference} against the others`} />
      {phase === "search" && (
        <section class="block">
          <h3>What a budget finds</h3>
          <Figures campaign={id} names={(name) => name === `preventable_found_${family}` || name === `distinct_found_${family}`} columns />
        </section>
      )}
      {phase === "search" && overview && <Kinds campaign={id} family={family} overview={overview} cells={cells} />}
    </section>
  );
}
