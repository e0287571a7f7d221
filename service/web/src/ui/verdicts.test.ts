import { expect, test } from "vitest";

import { egoPartWords, knownOf, preventedBy } from "./verdicts";
import type { Collision, Violation } from "./violations";

function broken(...preventing: string[]): Violation {
  const drivers = Object.fromEntries(["r157", "fsm", "rss", "full_braking", "r157_ttc"].map((name) => [name, preventing.includes(name)]));
  return { requirement: "never_fast", drivers } as unknown as Violation;
}

function contact(hidden: boolean, visible_for_s: number): Collision {
  const drivers = { rss: { avoids: true, impact_speed_mps: 0 }, full_braking: { avoids: true, impact_speed_mps: 0 } };
  return { other_id: "lead", visible_for_s, judgement: { hidden, drivers } } as unknown as Collision;
}

test("all drivers that would have prevented it are named", () => {
  expect(preventedBy(broken("full_braking"))).toBe("of the reference drivers, only full braking at once would have prevented it");
  expect(preventedBy(contact(false, 1))).toBe("the RSS driver and full braking at once would have prevented it");
  expect(preventedBy(broken("r157", "fsm", "full_braking"))).toBe("R157's driver, the fuzzy safety model and full braking at once would have prevented it");
  expect(preventedBy(broken("r157_ttc"))).toBe("none of the reference drivers would have prevented it; by R157's time-to-collision rule it is preventable");
  expect(preventedBy(broken("full_braking", "r157_ttc"))).toBe("of the reference drivers, only full braking at once would have prevented it; by R157's time-to-collision rule it is preventable");
  expect(preventedBy(broken())).toBe("none of the reference drivers would have prevented it");
  expect(preventedBy({ requirement: "x", drivers: {} } as unknown as Violation)).toBeNull();
});

test("what the ego knew is said once, of hiding and time together", () => {
  expect(knownOf(contact(false, 3))).toBe("lead had been in the ego's view for 3.0 s without a break.");
  expect(knownOf(contact(true, 1.2))).toBe("lead came into the ego's view only 1.2 s before the contact.");
  expect(knownOf(contact(true, 0))).toBe("lead was not in the ego's view when the conflict began, nor at the contact.");
  expect(knownOf(contact(false, 0))).toBe("lead was not in the ego's view at the contact, but when the conflict began.");
});

const PART = { seen_s: 2.3, braked_after_s: 1.1, braking_mps2: 4, possible_mps2: 7.6, gained_mps: 0.2, started: false, sight_mps: null, sighted_mps: null, left_first: "striker" };

function judged(changes: Partial<typeof PART> | Record<string, unknown> | null): Collision {
  return { judgement: { ego_part: changes && { ...PART, ...changes } } } as unknown as Collision;
}

test("what the ego did about the striker is one clause", () => {
  expect(egoPartWords(judged({}))).toBe("the ego braked 1.1 s after the conflict began, by 4.0 of 7.6 m/s²");
  expect(egoPartWords(judged({ braked_after_s: null, started: true, gained_mps: 1.4 }))).toBe(
    "the ego did not brake in the conflict; it drove on and gained 1.4 m/s though it saw the striker",
  );
  expect(egoPartWords(judged({ braked_after_s: 0, sight_mps: 5.8, sighted_mps: 13.6, left_first: "ego" }))).toBe(
    "the ego was braking when the conflict began, by 4.0 of 7.6 m/s²; it drove at 13.6 m/s where its sight allowed 5.8 m/s; it was the first to leave RSS's proper response",
  );
  expect(egoPartWords(judged(null))).toBeNull();
});
