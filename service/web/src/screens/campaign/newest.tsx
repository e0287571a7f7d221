/** Failures as they are found. */

import { address } from "../../router";
import { drivenWords } from "../../ui/driven";
import { GRADE_WORDS, type GradeName } from "../../ui/verdicts";
import { isContact, kindOf, gradeOf, worstOf } from "../../ui/violations";
import type { Found } from "./live";

export function Newest({ campaign, found }: { campaign: string; found: Found[] }) {
  return (
    <section class="card newest" aria-labelledby="newest-title">
      <h2 id="newest-title">Newest failures</h2>
      {found.length === 0 && <p class="faint small">None yet. Each valid one shows here as soon as it is found.</p>}
      <ol>
        {found.map((failure) => (
          <li key={failure.id}>
            <a href={address(["campaigns", campaign, "failures", failure.id])}>{described(failure)}</a>
            <span class="faint small">
              {failure.run_id}, episode {failure.index}
              {failure.driven_by && `, driven ${drivenWords(failure.driven_by)}`}
            </span>
          </li>
        ))}
      </ol>
    </section>
  );
}

function described(found: Found): string {
  const worst = worstOf(found);
  if (worst === null) return "failure";
  const kind = kindOf(worst).split(";")[0]!;
  const [named, mps] = isContact(worst) ? ["closing speed", worst.relative_speed_mps] : ["ego's speed", worst.ego_speed_mps];
  const grade = gradeOf(worst);
  return [kind, mps === null ? "" : `${named} ${mps.toFixed(1)} m/s`, grade && GRADE_WORDS[grade as GradeName].short].filter(Boolean).join(", ");
}
