import { expect, test } from "vitest";

import { knownOf, preventedBy } from "./verdicts";
import type { Collision, Violation } from "./violations";

function broken(...preventing: string[]): Violation {
  const drivers = Object.fromEntries(["r157", "fsm", "rss", "full_braking"].map((name) => [name, preventing.includes(name)]));
  return { requirement: "never_fast", drivers } as unknown as Violation;
}

function contact(hidden: boolean, visible_for_s: number): Collision {
  const drivers = { rss: { avoids: true, impact_speed_mps: 0 }, full_braking: { avoids: true, impact_speed_mps: 0 } };
  return { other_id: "lead", visible_for_s, judgement: { hidden, drivers } } as unknown as Collision;
}

test("all drivers that would have prevented it are named", () => {
  expect(preventedBy(broken("full_braking"))).toBe("only full braking at once would have prevented it");
  expect(preventedBy(contact(false, 1))).toBe("the RSS driver and full braking at once would have prevented it");
  expect(preventedBy(broken("r157", "fsm", "full_braking"))).toBe("R157's driver, the fuzzy safety model and full braking at once would have prevented it");
  expect(preventedBy(broken())).toBe("none of the reference drivers would have prevented it");
  expect(preventedBy({ requirement: "x", drivers: {} } as unknown as Violation)).toBeNull();
});

test("what the ego knew is said once, of hiding and time together", () => {
  expect(knownOf(contact(false, 3))).toBe("The ego had known of lead for 3.0 s without a break.");
  expect(knownOf(contact(true, 1.2))).toBe("The ego came to know of lead only 1.2 s before the contact.");
  expect(knownOf(contact(true, 0))).toBe("The ego did not know of lead when the conflict began, nor at the contact.");
  expect(knownOf(contact(false, 0))).toBe("The ego did not know of lead at the contact, but when the conflict began.");
});
