/** Violations of an episode, with and without contact: which one names it, and what was judged of it. */

import type { Body } from "../api/types";

export type Collision = Body<"Collision">;
export type Violation = Body<"Violation">;
type Recorded = Pick<Body<"Episode">, "outcome" | "collision" | "violations">;

export const NO_CONTACT = "no_contact";

export function isContact(violation: Collision | Violation): violation is Collision {
  return !("requirement" in violation);
}

export function isValid({ verdicts }: Collision | Violation): boolean {
  return Object.values(verdicts).every(Boolean);
}

export function requirementOf(violation: Collision | Violation): string {
  return isContact(violation) ? NO_CONTACT : violation.requirement;
}

/** What makes the episode a failure: a contact first, then by time. */
export function validOf({ outcome, collision, violations }: Recorded): (Collision | Violation)[] {
  if (outcome !== "failure") return [];
  return [...(collision ? [collision] : []), ...violations].filter(isValid);
}

/** The violation that names the episode, as `worst_of` in risk_sac/records/violation.py; without a valid one the contact, or the first. */
export function worstOf(episode: Recorded): Collision | Violation | null {
  const valid = validOf(episode);
  const preventable = valid.filter((violation) => gradeOf(violation) === "preventable");
  const serious = preventable.filter((violation) => severityOf(violation) !== "minor");
  const candidate = serious.find((violation) => plausibilityOf(violation)?.verdict !== "implausible");
  return candidate ?? serious[0] ?? preventable[0] ?? valid[0] ?? episode.collision ?? episode.violations[0] ?? null;
}

export function gradeOf(violation: Collision | Violation): Body<"Grade"> | null {
  return isContact(violation) ? violation.judgement.grade : violation.grade;
}

/** How likely road users do what the adversaries did; null where that was not judged. */
export function plausibilityOf(violation: Collision | Violation): Body<"Plausibility"> | null {
  return (isContact(violation) ? violation.judgement?.plausibility : violation.plausibility) ?? null;
}

/** Null without contact. */
export function severityOf(violation: Collision | Violation): Body<"Severity"> | null {
  return isContact(violation) ? (violation.judgement?.severity ?? null) : null;
}

/** Which party caused it; null where that was not judged. */
export function faultOf(violation: Collision | Violation): Body<"Fault"> | null {
  return (isContact(violation) ? violation.judgement?.fault : violation.fault) ?? null;
}

/** Each reference driver, and whether it would have prevented the violation. */
export function driversOf(violation: Collision | Violation): [string, boolean][] {
  if (!isContact(violation)) return Object.entries(violation.drivers);
  return Object.entries(violation.judgement?.drivers ?? {}).map(([name, { avoids }]) => [name, avoids]);
}

/** Its kind, in words. */
export function kindOf(violation: Collision | Violation): string {
  return isContact(violation) ? violation.judgement.kind : violation.kind;
}

/** Its variant within the kind, in words. */
export function variantOf(violation: Collision | Violation): string {
  return isContact(violation) ? violation.judgement.variant : violation.variant;
}
