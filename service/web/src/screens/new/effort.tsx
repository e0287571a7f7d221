/** The effort of a campaign: what each choice costs, and which known defects it detects. */

import type { Body } from "../../api/types";
import { count } from "../../ui/text";
import { bodyOf, textOf } from "./body";
import { useChecked } from "./checked";
import { applied, costOf, EFFORTS, isOf, type Effort } from "./presets";
import type { Shape, Values } from "./schema";
import type { TimeOf } from "./times";

interface Efforts {
  shape: Shape;
  spec: Values;
  /** As `applied` takes them. */
  scenarios: readonly string[];
  time: TimeOf;
  /** Makes what is posted of a body, such as one at places of a map. */
  located: (body: Values) => Values;
  choose: (spec: Values) => void;
}

export function Efforts(props: Efforts) {
  return (
    <div class="efforts" role="group" aria-label="Effort">
      {EFFORTS.map((effort) => (
        <EffortCard key={effort.title} effort={effort} {...props} />
      ))}
    </div>
  );
}

function EffortCard({ effort, shape, spec, scenarios, time, located, choose }: Efforts & { effort: Effort }) {
  const made = applied(effort, spec, scenarios, time);
  const cost = costOf(made, scenarios, time);
  const { episodes } = made.budget as { episodes: number };
  const checked = useChecked(textOf(located(bodyOf(shape, made))));
  return (
    <button type="button" class="effort" aria-pressed={isOf(effort, spec, scenarios, time)} onClick={() => choose(made)}>
      <b>{effort.title}</b>
      <span class="small">{effort.about}</span>
      <span>
        {count(cost.episodes)} episodes, about {roughly(cost.seconds)}
      </span>
      <span class="small">
        {effort.methods.join(", ")}: {count(episodes)} each, {effort.seeds.length === 1 ? "1 seed" : `${effort.seeds.length} seeds`}
      </span>
      {checked.state === "good" && <span class="small detects">{detects(checked.power)}</span>}
    </button>
  );
}

/** `risk-sac-diverse detects 7.2 of 18 known defects on average`; that nothing was measured where that is so. */
export function detects({ methods }: Body<"Power">): string {
  const told = methods.flatMap(({ method, expected, at_least, defects }) =>
    expected !== null && defects.length ? [`${method} detects ${at_least ? "at least " : ""}${Number(expected.toPrecision(2))} of ${defects.length} known defects on average`] : [],
  );
  return told.length ? `${told.join("; ")}.` : "What it detects is not measured yet.";
}

/** `40 s`, `28 min`, `8 h`. */
export function roughly(seconds: number): string {
  if (seconds < 90) return `${Math.max(1, Math.round(seconds))} s`;
  return seconds < 5400 ? `${Math.round(seconds / 60)} min` : `${Math.round(seconds / 3600)} h`;
}
