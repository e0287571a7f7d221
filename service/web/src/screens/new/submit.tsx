/** What the campaign costs, what is wrong with it, and the button that starts it. */

import type { Verdict } from "./checked";
import { count } from "../../ui/text";
import { detects, roughly } from "./effort";
import type { Wrong } from "./form";
import { costOf } from "./presets";
import type { Values } from "./schema";
import { timeWords, type TimeOf } from "./times";

interface Ready {
  spec: Values;
  /** As `applied` takes them. */
  scenarios: readonly string[];
  time: TimeOf;
  onMap: boolean;
  verdict: Verdict;
  wrong: readonly Wrong[];
  /** Why the last try was refused, where no field is to blame. */
  refused: string;
  busy: boolean;
}

export function Submit({ spec, scenarios, time, onMap, verdict, wrong, refused, busy }: Ready) {
  const length = (name: string) => (spec[name] as unknown[]).length;
  const { runs, episodes, seconds: cost_s } = costOf(spec, scenarios, time);
  return (
    <section class="card submit" aria-label="Start">
      <div class="tiles">
        <span class="tile">
          <b>{count(episodes)}</b>
          <span>episodes in all</span>
        </span>
        <span class="tile">
          <b>{count(runs)}</b>
          <span>{runs === 1 ? "run" : "runs"}</span>
        </span>
        <span class="tile">
          <b>{roughly(cost_s)}</b>
          <span>of one slot, about</span>
        </span>
      </div>
      <p class="help">
        {onMap ? plural(scenarios.length, "place", "places") : plural(scenarios.length, "scenario", "scenarios")} × {plural(length("methods"), "method", "methods")} ×{" "}
        {plural(length("seeds"), "seed", "seeds")}
        {spec.iid && ", and the i.i.d. phase"}
      </p>
      <p class="help">{timeWords(time, scenarios, spec.methods as string[])}</p>
      <button class="primary start" disabled={busy}>
        {busy ? "Starting …" : "Start the campaign"}
      </button>
      <p class="small verdict" role="status">
        {wrong.length === 0 && SAID[verdict.state]}
      </p>
      {verdict.state === "good" && wrong.length === 0 && <p class="help">{detects(verdict.power)}</p>}
      {verdict.state === "good" && wrong.length === 0 && verdict.adjustments.length > 0 && (
        <ul class="small adjustments">
          {verdict.adjustments.map(({ families, field, asked, used, why }) => (
            <li key={field + families.join()}>
              <button type="button" class="to-field" onClick={() => show(field)}>
                {field}
              </button>{" "}
              {families.join(", ")}: asked for {asked}, used {used}; {why}
            </li>
          ))}
        </ul>
      )}
      {refused && (
        <p class="wrong" role="alert">
          {refused}
        </p>
      )}
      {wrong.length > 0 && (
        <ul class="faults">
          {wrong.map(({ field, message }) => (
            <li key={field + message}>
              <button type="button" class="to-field" onClick={() => show(field)}>
                {field || "the campaign"}
              </button>{" "}
              {message}
            </li>
          ))}
        </ul>
      )}
    </section>
  );
}

const SAID: Record<Verdict["state"], string> = {
  silent: "",
  asking: "Checking …",
  good: "✓ The service would take it.",
  wrong: "",
};

function plural(n: number, one: string, several: string): string {
  return `${n} ${n === 1 ? one : several}`;
}

/** Leads to the field, or to the nearest one around it that is on the page. */
function show(field: string): void {
  for (let name = field; name !== ""; name = name.replace(/(^|\.|\[)[^.[]*$/, "")) {
    const found = document.getElementById(`field-${name}`);
    if (!found) continue;
    found.scrollIntoView({ block: "center" });
    (found.matches("input, select, textarea") ? found : found.querySelector<HTMLElement>("input, select, textarea"))?.focus();
    return;
  }
}
