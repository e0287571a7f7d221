/** Grades, rules and states in words; the words are those of the service's `caption.py` and README. */

import { words } from "../../ui/text";
import type { Facet } from "./filters";
import type { TriageState } from "./wire";

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

/** Why a contact was refused: what a rule found. */
const RULES: Record<string, string> = {
  no_teleport: "somebody was teleported",
  no_spawn_overlap: "bodies overlapped at the start",
  conflict_after_release: "the conflict began less than 1 s after the release",
  inside_limits: "an adversary left its limits",
  inside_grip: "the striker drove beyond the road's grip",
  solid_bodies: "a body passed through another one before",
  ego_model_saw: "SUMO does not list the collision",
  repeats: "it went another way when replayed",
  not_from_behind: "the ego was struck from behind",
  ego_moving: "the ego stood",
  no_sideswipe: "the adversary swiped the ego's side",
  seen_before: "the ego could never see the striker",
};

export function refusal(rule: string): string {
  return Object.hasOwn(RULES, rule) ? RULES[rule]! : words(rule);
}

export const TRIAGE: Record<TriageState, string> = {
  new: "New",
  confirmed: "Confirmed",
  dismissed: "Dismissed",
  fixed: "Fixed",
};

export const FACET_LABELS: Record<Facet, string> = {
  family: "Family",
  method: "Method",
  run: "Run",
  grade: "Grade",
  kind: "Kind",
  striker: "Striker",
  triage: "Triage",
  broke: "Striker broke",
  rule: "Refused by",
};

/** A value of a facet as people read it. */
export function valueWords(facet: Facet, value: string): string {
  if (facet === "grade" && Object.hasOwn(GRADE_WORDS, value)) return GRADE_WORDS[value as GradeName].short;
  if (facet === "triage" && Object.hasOwn(TRIAGE, value)) return TRIAGE[value as TriageState].toLowerCase();
  if (facet === "rule") return refusal(value);
  return facet === "striker" || facet === "broke" ? words(value) : value;
}

/** "cut-in, alongside; ego goes straight, brakes" -> what the striker did, and what the ego did. */
export function halves(kind: string): [string, string] {
  const at = kind.indexOf("; ");
  const [striker, ego] = at < 0 ? [kind, ""] : [kind.slice(0, at), kind.slice(at + 2)];
  return [capital(striker), capital(ego)];
}

function capital(text: string): string {
  return text.charAt(0).toUpperCase() + text.slice(1);
}
