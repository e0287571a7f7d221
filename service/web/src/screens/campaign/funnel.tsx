/** The funnel failures -> distinct -> preventable -> plausible -> headline over all requirements that count, as bars to one scale. */

import { count } from "../../ui/text";

export interface Counts {
  failures: number;
  distinct_failures: number;
  distinct_preventable: number;
  distinct_published: number;
  headline_candidates: number;
  implausible: number;
  headline: number | null;
  headline_published: number | null;
}

const STEPS = [
  ["failures", "failures", "Episodes with a valid violation of a requirement that counts; a contact violates one, too."],
  ["distinct_failures", "distinct", "Kinds of violations, each once in a run."],
  ["distinct_preventable", "preventable", "Kinds that a reference driver would have prevented."],
  ["headline_candidates", "plausible", "Preventable kinds with more than minor contacts, whose adversaries do what road users do."],
  ["headline", "headline", "Those that went the same way when replayed; what several runs found alike counts once."],
] as const;

/** @param most what the longest bar stands for, where several funnels are to be compared. */
export function Funnel({ counts, most = Math.max(counts.failures, counts.distinct_failures) }: { counts: Counts; most?: number }) {
  return (
    <ol class="stages" aria-label="Funnel">
      {STEPS.map(([name, word, meaning], step) => {
        const before = step ? counts[STEPS[step - 1]![0]] : 0;
        const now = counts[name];
        return (
          <li key={name} title={meaning + besideOf(name, counts)}>
            <span class="stage-word">{word}</span>
            <span class="stage-room">
              {now !== null && now > 0 && <span class={`stage-bar stage-${step + 1}`} style={{ width: `${(100 * now) / most}%` }} />}
            </span>
            <b data-count={name}>{now === null ? "–" : count(now)}</b>
            <span class="stage-share">{before && now !== null ? share(now, before) : ""}</span>
          </li>
        );
      })}
      {counts.implausible > 0 && (
        <li key="implausible" title="Preventable ones that are no minor contacts, but whose adversaries do what no road user does. They are in no headline.">
          <span class="stage-word">implausible</span>
          <span class="stage-room" />
          <b data-count="implausible">{count(counts.implausible)}</b>
          <span class="stage-share" />
        </li>
      )}
    </ol>
  );
}

/** How many of the preventable ones R157, FSM or RSS would have prevented. */
function besideOf(step: (typeof STEPS)[number][0], counts: Counts): string {
  if (step === "distinct_preventable") return ` R157, FSM or RSS would have prevented ${counts.distinct_published}.`;
  if (step === "headline" && counts.headline !== null) return ` R157, FSM or RSS would have prevented ${counts.headline_published ?? 0}.`;
  return "";
}

function share(part: number, of: number): string {
  const percent = (100 * part) / of;
  return `${percent > 0 && percent < 1 ? "< 1" : Math.round(percent)} %`;
}
