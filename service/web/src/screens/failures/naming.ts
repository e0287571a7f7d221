/** What can be filtered by, in words. */

import { drivenWords } from "../../ui/driven";
import { capital, words } from "../../ui/text";
import { driverWords, GRADE_WORDS, refusal, type GradeName } from "../../ui/verdicts";
import type { Facet } from "./filters";
import type { TriageState } from "./wire";

export const TRIAGE: Record<TriageState, string> = {
  new: "New",
  confirmed: "Confirmed",
  dismissed: "Dismissed",
  fixed: "Fixed",
};

export const FACET_LABELS: Record<Facet, string> = {
  requirement: "Requirement",
  family: "Family",
  method: "Method",
  run: "Run",
  grade: "Grade",
  plausibility: "Plausibility",
  severity: "Severity",
  fault: "Fault",
  driven_by: "Driven by",
  prevented_by: "Prevented by",
  kind: "Kind",
  striker: "Striker",
  triage: "Triage",
  broke: "Striker broke",
  ego_broke: "Ego broke",
  rule: "Refused by",
};

const WORDED: ReadonlySet<Facet> = new Set(["requirement", "striker", "broke", "ego_broke"]);

/** A value of a facet as people read it. */
export function valueWords(facet: Facet, value: string): string {
  if (facet === "grade" && Object.hasOwn(GRADE_WORDS, value)) return GRADE_WORDS[value as GradeName].short;
  if (facet === "triage" && Object.hasOwn(TRIAGE, value)) return TRIAGE[value as TriageState].toLowerCase();
  if (facet === "rule") return refusal(value);
  if (facet === "driven_by") return value === "unknown" ? "not recorded" : drivenWords(value);
  if (facet === "prevented_by" && value !== "nothing") return driverWords(value);
  return WORDED.has(facet) ? words(value) : value;
}

/** "cut-in, alongside; ego goes straight, brakes" -> what the striker did, and what the ego did. */
export function halves(kind: string): [string, string] {
  const at = kind.indexOf("; ");
  const [striker, ego] = at < 0 ? [kind, ""] : [kind.slice(0, at), kind.slice(at + 2)];
  return [capital(striker), capital(ego)];
}
