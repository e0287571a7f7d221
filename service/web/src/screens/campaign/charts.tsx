/** The curves of a search, all over the same episodes: one pointer, one zoom, one legend. */

import { useMemo, useState } from "preact/hooks";
import type { Body } from "../../api/types";
import { Chart, type Line } from "./chart";
import { trailing, WINDOW, type Curve } from "./curves";
import { warmUp } from "./driven";
import { groupName, markOf, runName } from "./look";
import { Sample } from "./sample";
import { Strips } from "./strips";

type Spec = Body<"CampaignSpec">;

interface Panels {
  spec: Spec;
  curves: Curve[];
  hidden: ReadonlySet<string>;
  hide: (runs: string[], away: boolean) => void;
}

const RATES = [
  ["window_ecr", "ECR", `valid contacts per episode, last ${WINDOW}`],
  ["window_pcr", "PCR", `preventable contacts per episode, last ${WINDOW}`],
] as const;
const COUNTS = [
  ["distinct", "Distinct", "distinct violations so far, of all requirements"],
  ["distinct_preventable", "Preventable", "distinct preventable violations so far, of all requirements"],
] as const;

export function Charts({ spec, curves, hidden, hide }: Panels) {
  const [rate, setRate] = useState(0);
  const [found, setFound] = useState(0);
  const [pointed, setPointed] = useState<string | null>(null);
  const shown = useMemo(() => curves.filter((curve) => !hidden.has(curve.run_id)), [curves, hidden]);
  const lines = (values: (curve: Curve) => (number | null)[]): Line[] =>
    shown.map((curve) => ({ run: curve.run_id, name: runName(spec, curve), mark: markOf(spec, curve), x: curve.episodes, y: values(curve), warmUp: warmUp(curve) }));
  const rates = useMemo(() => lines((curve) => curve[RATES[rate]![0]]), [shown, rate]);
  const counts = useMemo(() => lines((curve) => curve[COUNTS[found]![0]]), [shown, found]);
  const multipliers = useMemo(() => lines((curve) => curve.dual_variable), [shown]);
  const costs = useMemo(() => lines((curve) => trailing(curve.episodes, curve.mean_cost, WINDOW)), [shown]);
  const constrained = curves.some((curve) => curve.dual_variable.some(Boolean));
  return (
    <section aria-label="Curves over episodes">
      <div class="row over-row">
        <h2>Over episodes</h2>
        <Legend spec={spec} curves={curves} hidden={hidden} hide={hide} point={setPointed} />
        <Choice label="Rate" names={RATES.map((each) => each[1])} chosen={rate} choose={setRate} />
        <Choice label="Count" names={COUNTS.map((each) => each[1])} chosen={found} choose={setFound} />
      </div>
      {rates.some((line) => line.warmUp > 0) && <p class="faint small warm-up">Shaded: the warm-up, which is the episodes before the policy's first.</p>}
      <div class="curves">
        <Strips curves={shown} nameOf={(curve) => runName(spec, curve)} />
        <Chart title={`Sliding ${RATES[rate]![1]}`} meaning={RATES[rate]![2]} lines={rates} written={percent} atLeast={0.1} pointed={pointed} />
        <Chart title={`${COUNTS[found]![1]} failures`} meaning={COUNTS[found]![2]} lines={counts} written={whole} atLeast={4} pointed={pointed} />
        {constrained ? (
          <Chart title="Dual variable λ" meaning="weight of the realism cost in the search" lines={multipliers} written={decimals} atLeast={0.1} pointed={pointed} />
        ) : (
          <section class="card curve curve-none" aria-label="Dual variable λ">
            <h3>Dual variable λ</h3>
            <p class="faint">λ is 0 throughout: none of these runs has to hold a limit of realism cost, or none has reached it yet.</p>
          </section>
        )}
        <Chart title="Realism cost" meaning={`mean per step, last ${WINDOW} episodes; lower is more realistic`} lines={costs} written={decimals} atLeast={0.2} pointed={pointed} />
      </div>
    </section>
  );
}

interface Groups extends Panels {
  point: (run: string | null) => void;
}

/** An entry for each style of line; runs that differ in their seed alone share one. */
function Legend({ spec, curves, hidden, hide, point }: Groups) {
  const groups = new Map<string, Curve[]>();
  for (const curve of curves) {
    const name = groupName(spec, curve);
    groups.set(name, [...(groups.get(name) ?? []), curve]);
  }
  return (
    <div class="row run-legend" role="group" aria-label="Runs in the curves">
      {[...groups].map(([name, members]) => {
        const runs = members.map((curve) => curve.run_id);
        const away = runs.every((run) => hidden.has(run));
        const alone = runs.length === 1 ? runs[0]! : null;
        return (
          <button
            key={name}
            class="quiet"
            aria-pressed={!away}
            onClick={() => hide(runs, !away)}
            onPointerEnter={() => point(alone)}
            onPointerLeave={() => point(null)}
            onFocus={() => point(alone)}
            onBlur={() => point(null)}
          >
            <Sample mark={markOf(spec, members[0]!)} /> {name}
            {runs.length > 1 && <span class="faint"> × {runs.length}</span>}
          </button>
        );
      })}
    </div>
  );
}

function Choice({ label, names, chosen, choose }: { label: string; names: string[]; chosen: number; choose: (at: number) => void }) {
  return (
    <span class="joined" role="group" aria-label={label}>
      {names.map((name, at) => (
        <button key={name} aria-pressed={at === chosen} onClick={() => choose(at)}>
          {name}
        </button>
      ))}
    </span>
  );
}

function percent(value: number): string {
  const hundred = 100 * value;
  return `${Number.isInteger(Math.round(hundred * 10) / 10) ? Math.round(hundred) : hundred.toFixed(1)} %`;
}

function whole(value: number): string {
  return Number.isInteger(value) ? value.toLocaleString("en") : "";
}

function decimals(value: number): string {
  return value.toFixed(2);
}
