/** Grades and rules in words; the rules are those of `risk_sac/verdicts/README.md`. */

import { words } from "./text";

export const GRADES = ["careful", "ideal", "unavoidable", "none"] as const;
export type GradeName = (typeof GRADES)[number];

interface GradeWords {
  short: string;
  long: string;
}

export const GRADE_WORDS: Record<GradeName, GradeWords> = {
  careful: { short: "preventable", long: "A careful driver would have prevented it" },
  ideal: { short: "only by full braking", long: "Only full braking at once would have prevented it" },
  unavoidable: { short: "unavoidable", long: "Not even full braking at once would have prevented it" },
  none: { short: "not graded", long: "No reference driver was asked" },
};

/** Why a violation was refused: what a rule found. */
const RULES: Record<string, string> = {
  no_teleport: "the simulator moved somebody by a jump",
  no_spawn_overlap: "two bodies overlapped before the release",
  conflict_after_release: "the conflict began less than 1 s after the release",
  inside_limits: "an adversary left its limits",
  inside_grip: "the striker drove beyond the road's grip",
  solid_bodies: "two bodies overlapped before the contact",
  ego_model_saw: "SUMO does not list the collision",
  repeats: "it went another way when replayed",
  not_from_behind: "the ego was struck from behind",
  ego_moving: "the ego stood, or nearly",
  no_sideswipe: "the adversary swiped the ego's side",
  seen_before: "the ego could never see the striker",
};

export function refusal(rule: string): string {
  return Object.hasOwn(RULES, rule) ? RULES[rule]! : words(rule);
}
