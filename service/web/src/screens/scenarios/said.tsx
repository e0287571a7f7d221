/** What a check says of a scenario document: its faults, or what scenes without an attack show. */

import type { Body } from "../../api/types";
import { count } from "../../ui/text";

export type Verdict =
  | { state: "silent" }
  | { state: "asking" }
  | { state: "good"; check: Body<"ScenarioCheck"> }
  | { state: "wrong"; wrong: readonly Body<"FieldProblem">[]; why: string };

export function Said({ verdict }: { verdict: Verdict }) {
  if (verdict.state === "silent") return <p class="small faint">It is checked while you type. Nothing is stored until you save it.</p>;
  if (verdict.state === "asking") {
    return (
      <p class="faint" role="status">
        <span class="spinner" aria-hidden="true" /> Checking: 20 scenes are played …
      </p>
    );
  }
  if (verdict.state === "good") return <Good check={verdict.check} />;
  return (
    <div class="bad" role="alert">
      {verdict.wrong.length === 0 ? (
        <p class="breaking">{verdict.why}</p>
      ) : (
        <ul class="breaking">
          {verdict.wrong.map(({ field, message }) => (
            <li key={field + message}>
              {field && <code>{field}</code>} {message}
            </li>
          ))}
        </ul>
      )}
    </div>
  );
}

function Good({ check }: { check: Body<"ScenarioCheck"> }) {
  const refused = Object.entries(check.refused);
  const warned = [
    ...(check.contacts ? [`${count(check.contacts)} contacts without an attack`] : []),
    ...check.invalid.map((why) => `not played to the end: ${why}`),
    ...check.out_of_reach.map((name) => `${name} cannot come near the ego's way`),
    ...check.without_effect.map((name) => `${name} changes no start`),
    ...check.remarks,
  ];
  return (
    <div role="status">
      <p class="good">The service would take it.</p>
      <p class="small">
        {count(check.played)} of {count(check.scenes)} scenes played, {Math.round(check.seconds)} s of simulated time
        {refused.length > 0 && `; refused: ${refused.map(([rule, scenes]) => `${scenes} by ${rule}`).join(", ")}`}.
      </p>
      {warned.length > 0 && (
        <ul class="small warned breaking">
          {warned.map((line) => (
            <li key={line}>{line}</li>
          ))}
        </ul>
      )}
    </div>
  );
}
