/** A grade as its mark and its words. */

import { FILLED, PATHS } from "./marks";
import { GRADE_WORDS, type GradeName } from "../../ui/verdicts";

export function Mark({ grade }: { grade: GradeName }) {
  return (
    <svg class={`mark mark-${grade}`} viewBox="0 0 16 16" width="12" height="12" aria-hidden="true">
      <path d={PATHS[grade]} data-filled={FILLED[grade] || undefined} />
    </svg>
  );
}

export function GradeTag({ grade }: { grade: GradeName }) {
  return (
    <span class="grade" title={GRADE_WORDS[grade].long}>
      <Mark grade={grade} /> {GRADE_WORDS[grade].short}
    </span>
  );
}
