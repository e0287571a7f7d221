/** The funnel contacts -> valid -> distinct -> preventable, as bars to one scale. */

import { count } from "../../ui/text";

export interface Counts {
  raw_collisions: number;
  failures: number;
  distinct_failures: number;
  distinct_preventable: number;
}

const STEPS = [
  ["raw_collisions", "contacts", "What the ego touched."],
  ["failures", "valid", "No artefact, and not the ego's to suffer: the effective collisions."],
  ["distinct_failures", "distinct", "Each kind once, per run."],
  ["distinct_preventable", "preventable", "Distinct ones that the careful driver would have prevented."],
] as const;

/** @param most what the longest bar stands for, where several funnels are to be compared. */
export function Funnel({ counts, most = counts.raw_collisions }: { counts: Counts; most?: number }) {
  return (
    <ol class="stages" aria-label="Funnel">
      {STEPS.map(([name, word, meaning], step) => {
        const before = step ? counts[STEPS[step - 1]![0]] : 0;
        return (
          <li key={name} title={meaning}>
            <span class="stage-word">{word}</span>
            <span class="stage-room">
              {counts[name] > 0 && <span class={`stage-bar stage-${step}`} style={{ width: `${(100 * counts[name]) / most}%` }} />}
            </span>
            <b data-count={name}>{count(counts[name])}</b>
            <span class="stage-share">{before ? share(counts[name], before) : ""}</span>
          </li>
        );
      })}
    </ol>
  );
}

function share(part: number, of: number): string {
  const percent = (100 * part) / of;
  return `${percent > 0 && percent < 1 ? "< 1" : Math.round(percent)} %`;
}
