/** What the verdicts say, in plain words; the rules are those of `risk_sac/verdicts/README.md`. */

import type { Body } from "../../api/types";
import { capital, number, words } from "../../ui/text";
import { egoPartWords, preventedBy, refusal, TTC_RULE } from "../../ui/verdicts";
import { faultOf, isContact, plausibilityOf, worstOf, type Collision, type Violation } from "../../ui/violations";

type Failure = Body<"Failure">;
type Judgement = Body<"Judgement">;

const CONFLICTS: Record<string, string> = {
  cut_in: "a cut-in",
  merge: "the ego's move over to its neighbour",
  leader: "a leader that slows down",
  pedestrian: "a pedestrian in the way",
  crossing_vehicle: "a crossing vehicle",
};

/** How a sentence about a contact begins. */
const BEGINNINGS: Record<string, string> = {
  cut_in: "In a cut-in",
  merge: "As the ego moved over to its neighbour",
  leader: "Behind a leader that slowed down",
  pedestrian: "With a pedestrian in its way",
  crossing_vehicle: "With a vehicle crossing its way",
};

const MANOEUVRES: Record<string, string> = { straight: "goes straight", left_turn: "turns left", right_turn: "turns right", lane_change: "changes lanes" };

const RESPONSES: Record<string, string> = {
  none: "does not brake",
  late_braking: "brakes late",
  braking: "brakes",
  standing: "stands",
  starting: "starts",
  accelerating: "speeds up",
};

const BROKE: Record<string, string> = {
  red_light: "ran a red light",
  priority: "took the ego's priority",
  wrong_direction: "went in the wrong direction",
  speeding: "was more than 10 % too fast",
  pedestrian_on_red: "walked on red",
  unsafe_lane_change: "changed lanes without a safe gap",
  brake_check: "braked hard before the ego for no reason",
  turned_into_path: "turned into the ego's way",
};

const EGO_BROKE: Record<string, string> = {
  ...BROKE,
  priority: "took the striker's priority",
  wrong_direction: "was on the oncoming side",
  off_road: "left the road",
};

export function verdictOf(failure: Failure): string {
  const { outcome } = failure;
  const violation = worstOf(failure);
  const prevented = violation && preventedBy(violation);
  if (prevented) return `${capital(prevented)}.`;
  return outcome === "failure" ? "It counts as a failure; no reference driver was tried." : "A rule refused it as a failure.";
}

/** Names of the rules that refused it, with what each means. */
export function refusals(violation: Collision | Violation): string[] {
  return Object.entries(violation.verdicts).flatMap(([rule, passed]) => (passed ? [] : [refusal(rule)]));
}

/** The verdict in three sentences: what happened, whose fault it is and why, and how plausible it is. */
export function threeSentences(violation: Collision | Violation): [string, string, string] {
  return [happenedOf(violation), faultOfWords(violation), plausibleOf(violation)];
}

/** What happened, in one sentence. */
export function happenedOf(violation: Collision | Violation): string {
  return isContact(violation) ? contactOf(violation) : violationOf(violation);
}

export function violationOf({ requirement, time_s, robustness, ego_speed_mps, other_id, other_role, other_kind, hidden }: Violation): string {
  const near = other_id === null ? "" : `; it would have met the ${other_role} ${other_kind} ${other_id} soonest${hidden ? ", of which it knew nothing" : ""}`;
  return `The ego violated ${words(requirement)} ${number(time_s, 1)} s after the release at ${number(ego_speed_mps, 1)} m/s, by ${number(robustness === null ? null : -robustness, 2)} scales${near}.`;
}

const AT_FAULT: Record<string, string> = { ego: "The ego is at fault", shared: "Both are at fault", other: "The other road user is at fault" };

function faultOfWords(violation: Collision | Violation): string {
  const fault = faultOf(violation);
  if (fault === null) return "The fault was not judged.";
  const [theirs, own] = isContact(violation) ? [violation.judgement?.broke ?? [], violation.judgement?.ego_broke ?? []] : [[], violation.broke];
  const why = [theirs.length ? `the striker ${offences(theirs, BROKE)}` : null, own.length ? `the ego ${offences(own, EGO_BROKE)}` : null, egoPartWords(violation)];
  const told = why.filter((each) => each !== null).join("; ");
  return `${AT_FAULT[fault] ?? `Fault: ${fault}`}${told && `: ${told}`}.`;
}

function plausibleOf(violation: Collision | Violation): string {
  const plausibility = plausibilityOf(violation);
  if (plausibility === null) return "How plausible it is was not judged.";
  return `It is ${plausibility.verdict}${plausibility.sentence && `: ${plausibility.sentence}`}.`;
}

/** The other requirements that the episode violated, and those that are only reported. */
export function othersOf({ requirements }: Failure, named: string): string[] {
  return Object.entries(requirements).flatMap(([name, { counts, violated_s }]) =>
    name === named || violated_s === null ? [] : [`${words(name)} at ${number(violated_s, 1)} s${counts === "report" ? ", which is only reported" : ""}`],
  );
}

/** What a reference driver would have done. */
export function wouldOf(driver: string, prevents: boolean, contact: boolean): string {
  if (driver === TTC_RULE) return prevents ? "✓ call it preventable" : "✗ call it unpreventable";
  if (prevents) return contact ? "✓ prevent it" : "✓ keep the requirement";
  return contact ? "✗ strike" : "✗ violate it";
}

function contactOf(collision: Collision): string {
  const { ego_zone, ego_speed_mps, other_zone, other_role, other_id, relative_speed_mps, judgement } = collision;
  const beginning = judgement && BEGINNINGS[judgement.conflict_type];
  const conflict = beginning ? `${beginning}, the` : "The";
  const touched = `${conflict} ego's ${ego_zone} touched the ${other_zone} of the ${other_role} ${other_id} at ${number(ego_speed_mps, 1)} m/s`;
  const closing = `closing speed ${number(relative_speed_mps, 1)} m/s`;
  if (judgement?.severity == null || judgement.injury_risk == null) return `${touched}, ${closing}.`;
  return `${touched}, ${closing}: ${judgement.severity}, with a ${number(100 * judgement.injury_risk, 1)} % risk of ${judgement.harm}.`;
}

export function conflictOf({ conflict_type, conflict_s, position, hidden }: Judgement, { time_s, visible_for_s }: Collision): string {
  let before = "";
  if (hidden && !visible_for_s) before = ", which was hidden until the contact";
  else if (conflict_s !== null && time_s !== null) before = `, which ${hidden ? "began in hiding and came into sight" : "began"} ${number(time_s - conflict_s, 1)} s before the contact`;
  const where = position === "alongside" ? "alongside" : "ahead";
  return `The conflict is ${CONFLICTS[conflict_type] ?? words(conflict_type)}${before}; the striker was ${where} then.`;
}

export function manoeuvreOf(name: string): string {
  return MANOEUVRES[name] ?? words(name);
}

export function responseOf(judgement: Judgement, peak: number | null): string {
  const goes = manoeuvreOf(judgement.ego_manoeuvre);
  const does = RESPONSES[judgement.ego_response] ?? words(judgement.ego_response);
  const hardest = peak === null || peak < 0.05 ? "" : `; its hardest braking since the release was ${number(peak, 1)} m/s²`;
  const never = judgement.unresponsive ? " It saw a collision course for 1.5 s or more, and never braked." : "";
  return `The ego ${goes}, and in the last second ${does}${hardest}.${never}`;
}

export function brokeOf({ broke, ego_broke }: Judgement): string {
  return `The striker ${offences(broke, BROKE)}. ${egoBrokeOf(ego_broke)}`;
}

function egoBrokeOf(broke: readonly string[]): string {
  return `The ego ${offences(broke, EGO_BROKE)}.`;
}

function offences(rules: readonly string[], named: Record<string, string>): string {
  return rules.length === 0 ? "broke no rule of the road" : rules.map((rule) => named[rule] ?? words(rule)).join(", and ");
}

export function repetitionOf({ repetition }: Failure): string {
  if (repetition === null) return "It was not replayed: only the first failure of each kind is, once its run has ended.";
  const { same, times } = repetition;
  if (same === times) return `Verified: ${same} of ${times} replays were the same, to the bit.`;
  return `Flaky: only ${same} of ${times} replays were the same.`;
}
