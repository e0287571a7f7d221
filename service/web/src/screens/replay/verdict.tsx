/** The verdict in three sentences, then what reference drivers would have done, and further facts. */

import type { Body } from "../../api/types";
import { capital, number } from "../../ui/text";
import { TTC_RULE, driverWords, knownOf } from "../../ui/verdicts";
import { driversOf, gradeOf, isContact, requirementOf, worstOf, type Collision, type Violation } from "../../ui/violations";
import * as say from "./words";

type Failure = Body<"Failure">;

export function Verdict({ failure }: { failure: Failure }) {
  const violation = worstOf(failure);
  if (violation === null) return <p class="card">No violation is on record.</p>;
  const refused = say.refusals(violation);
  const others = say.othersOf(failure, requirementOf(violation));
  const flaky = failure.repetition !== null && failure.repetition.same < failure.repetition.times;
  return (
    <section class="card replay-verdict" aria-label="Verdict">
      {refused.length > 0 && (
        <div class="verdict-refused">
          <p>Refused by {refused.length === 1 ? "this rule" : "these rules"}:</p>
          <ul>
            {refused.map((why) => (
              <li>{why}</li>
            ))}
          </ul>
        </div>
      )}
      <div class="verdict-sentences">
        {say.threeSentences(violation).map((sentence) => (
          <p>{sentence}</p>
        ))}
      </div>
      <p class={`verdict-grade grade-${gradeOf(violation) ?? "none"}`}>{say.verdictOf(failure)}</p>
      <Drivers violation={violation} />
      <p class={flaky ? "bad" : "faint"}>{say.repetitionOf(failure)}</p>
      <Triage failure={failure} />
      <details>
        <summary>Further facts</summary>
        {isContact(violation) ? <OfContact collision={violation} /> : <p>The ego {say.manoeuvreOf(violation.ego_manoeuvre)}.</p>}
        {others.length > 0 && <p class="faint">The episode violated too: {others.join("; ")}.</p>}
      </details>
    </section>
  );
}

function OfContact({ collision }: { collision: Collision }) {
  const { judgement } = collision;
  if (judgement === null) return null;
  return (
    <>
      <p>{say.conflictOf(judgement, collision)}</p>
      <p>
        {say.responseOf(judgement, collision.ego_peak_braking_mps2)} {knownOf(collision)}
      </p>
      <p>{say.brokeOf(judgement)}</p>
      <p>The impact speed was {number(judgement.impact_mps, 1)} m/s, the striker's speed {number(collision.other_speed_mps, 1)} m/s.</p>
    </>
  );
}

/** What each reference driver would have done; of one that touches the striker, how fast it is itself then. */
function Drivers({ violation }: { violation: Collision | Violation }) {
  const rows = driversOf(violation);
  if (rows.length === 0) return null;
  const struck = isContact(violation) ? violation.judgement?.drivers : undefined;
  return (
    <table class="verdict-drivers">
      <caption>In the ego's place</caption>
      <thead>
        <tr>
          <th scope="col">Driver</th>
          <th scope="col">Would</th>
          {struck && (
            <th scope="col" class="number">
              Its own speed
            </th>
          )}
        </tr>
      </thead>
      <tbody>
        {rows.map(([name, prevents]) => (
          <tr key={name}>
            <th scope="row">{capital(driverWords(name))}</th>
            <td>
              <span class={prevents ? "good" : "bad"}>{say.wouldOf(name, prevents, struck !== undefined)}</span>
            </td>
            {struck && <td class="number">{prevents || name === TTC_RULE ? "–" : `${number(struck[name]!.impact_speed_mps, 1)} m/s`}</td>}
          </tr>
        ))}
      </tbody>
    </table>
  );
}

/** What was noted about it, where the service keeps such notes. */
function Triage({ failure }: { failure: Failure }) {
  const { triage } = failure;
  if (triage === null) return null;
  return (
    <p class="verdict-triage">
      <span class="tag">{triage.state}</span> {triage.comment}
    </p>
  );
}
