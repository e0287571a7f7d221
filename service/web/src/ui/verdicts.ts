/** Verdicts in words, from the facts on record: grades, reference drivers, sight, rules of `risk_sac/verdicts/README.md`. */

import { number, words } from "./text";
import type { Body } from "../api/types";
import { driversOf, isContact, type Collision, type Violation } from "./violations";

export const GRADES = ["preventable", "full_braking", "unavoidable", "none"] as const;
export type GradeName = (typeof GRADES)[number];

interface GradeWords {
  short: string;
  long: string;
}

export const GRADE_WORDS: Record<GradeName, GradeWords> = {
  preventable: { short: "preventable", long: "A reference driver would have prevented it" },
  full_braking: { short: "by full braking", long: "Of the reference drivers, only full braking at once would have prevented it" },
  unavoidable: { short: "unavoidable", long: "Neither a reference driver nor full braking at once would have prevented it" },
  none: { short: "not graded", long: "No reference driver was tried" },
};

const FULL_BRAKING = "full_braking";
/** A rule and no driver: it makes nothing preventable, and has no impact speed. */
export const TTC_RULE = "r157_ttc";

export const DRIVERS: Record<string, string> = {
  r157: "R157's driver",
  fsm: "the fuzzy safety model",
  rss: "the RSS driver",
  defensive: "the defensive driver",
  published: "R157, FSM or RSS",
  [FULL_BRAKING]: "full braking at once",
  [TTC_RULE]: "R157's time-to-collision rule",
};

/** Reference drivers by a regulation or a publication. */
export const PUBLISHED: readonly string[] = ["r157", "fsm", "rss"];

export function driverWords(name: string): string {
  return Object.hasOwn(DRIVERS, name) ? DRIVERS[name]! : `the ${words(name)} driver`;
}

/** Every reference driver that would have prevented it, by name; null where none was asked. */
export function preventedBy(violation: Collision | Violation): string | null {
  const drivers = driversOf(violation);
  if (drivers.length === 0) return null;
  const names = drivers.flatMap(([name, prevents]) => (prevents && name !== TTC_RULE ? [name] : []));
  const byRule = drivers.some(([name, prevents]) => prevents && name === TTC_RULE) ? `; by ${DRIVERS[TTC_RULE]} it is preventable` : "";
  if (names.length === 1 && names[0] === FULL_BRAKING) return `of the reference drivers, only ${DRIVERS[FULL_BRAKING]} would have prevented it${byRule}`;
  const told = names.length > 0 ? names.map(driverWords) : ["none of the reference drivers"];
  const last = told.pop()!;
  return `${told.length > 0 ? `${told.join(", ")} and ${last}` : last} would have prevented it${byRule}`;
}

/** Since when the striker was in the ego's view; what a defect keeps from the ego counts too. */
export function knownOf({ visible_for_s, other_id, judgement }: Collision): string {
  const seen_s = visible_for_s ?? 0;
  if (judgement?.hidden) {
    if (seen_s > 0) return `${other_id} came into the ego's view only ${number(seen_s, 1)} s before the contact.`;
    return `${other_id} was not in the ego's view when the conflict began, nor at the contact.`;
  }
  if (seen_s > 0) return `${other_id} had been in the ego's view for ${number(seen_s, 1)} s without a break.`;
  return `${other_id} was not in the ego's view at the contact${judgement ? ", but when the conflict began" : ""}.`;
}

/** What the ego did about the striker; null where that is not on record. */
export function egoPartWords(violation: Collision | Violation): string | null {
  const part = isContact(violation) ? violation.judgement?.ego_part : null;
  return part == null ? null : `the ego ${egoDid(part)}`;
}

const GAINS_MPS = 1;
const TOO_FAST = 1.1;

/** What the ego did about the striker; as `risk_sac/records/judgement.py` says it. */
function egoDid({ braked_after_s, braking_mps2, possible_mps2, gained_mps, started, sight_mps, sighted_mps, left_first }: Body<"EgoPart">): string {
  const told = [braked(braked_after_s, `by ${number(braking_mps2, 1)} of ${number(possible_mps2, 1)} m/s²`)];
  const sped = [...(started ? ["drove on"] : []), ...((gained_mps ?? 0) >= GAINS_MPS ? [`gained ${number(gained_mps, 1)} m/s`] : [])];
  if (sped.length > 0) told.push(`${sped.join(" and ")} though it saw the striker`);
  if (sight_mps !== null && (sighted_mps ?? 0) > TOO_FAST * sight_mps) told.push(`drove at ${number(sighted_mps, 1)} m/s where its sight allowed ${number(sight_mps, 1)} m/s`);
  if (left_first === "ego") told.push("was the first to leave RSS's proper response");
  return told.join("; it ");
}

function braked(after_s: number | null, by: string): string {
  if (after_s === null) return "did not brake in the conflict";
  return after_s === 0 ? `was braking when the conflict began, ${by}` : `braked ${number(after_s, 1)} s after the conflict began, ${by}`;
}

/** Why a violation was refused: what a rule found. */
const RULES: Record<string, string> = {
  no_teleport: "the simulator made a road user jump",
  no_spawn_overlap: "two bodies overlapped before the release",
  conflict_after_release: "the ego inherited the conflict, or a red light, at the release",
  inside_limits: "an adversary left its limits",
  inside_grip: "the striker drove beyond the road's grip",
  solid_bodies: "two bodies overlapped before the contact",
  ego_model_saw: "SUMO does not list the collision",
  repeats: "a replay went differently",
  not_from_behind: "the ego was struck from behind",
  ego_moving: "the ego stood, or nearly",
  no_sideswipe: "the adversary swiped the ego's side",
  seen_before: "the ego could never see the striker",
};

export function refusal(rule: string): string {
  return Object.hasOwn(RULES, rule) ? RULES[rule]! : words(rule);
}
