import { expect, test } from "vitest";
import type { Collision, Violation } from "../../ui/violations";
import { threeSentences } from "./words";

test("a contact is told in three sentences", () => {
  const judgement = {
    conflict_type: "cut_in",
    severity: "moderate",
    injury_risk: 0.123,
    harm: "injury",
    fault: "other",
    broke: ["unsafe_lane_change", "speeding"],
    ego_broke: [],
    ego_part: null,
    plausibility: { verdict: "rare", sentence: "left changes lane at 1 of 10,000" },
  };
  const contact = { ego_zone: "front", ego_speed_mps: 12.34, other_zone: "side", other_role: "adversary", other_id: "left", relative_speed_mps: 5, judgement };
  expect(threeSentences(contact as unknown as Collision)).toEqual([
    "In a cut-in, the ego's front touched the side of the adversary left at 12.3 m/s, closing speed 5.0 m/s: moderate, with a 12.3 % risk of injury.",
    "The other road user is at fault: the striker changed lanes without a safe gap, and was more than 10 % too fast.",
    "It is rare: left changes lane at 1 of 10,000.",
  ]);
});

test("a violation without contact is told in three sentences, of which two may be unknown", () => {
  const violation = { requirement: "never_fast", time_s: 2, robustness: -0.5, ego_speed_mps: 9, other_id: null, broke: ["red_light"], fault: "ego" };
  expect(threeSentences(violation as unknown as Violation)).toEqual([
    "The ego violated never fast 2.0 s after the release at 9.0 m/s, by 0.50 scales.",
    "The ego is at fault: the ego ran a red light.",
    "How plausible it is was not judged.",
  ]);
});
