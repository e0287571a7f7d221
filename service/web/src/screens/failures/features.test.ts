import { expect, test } from "vitest";
import { outcomeFeatures, reactionOf, sceneFeatures, withUnit } from "./features";
import { sample } from "./sample";

const table = sample(6);

test("the time from conflict to contact is R157's driver's", () => {
  expect(reactionOf(table, 3)).toBe(4);
  expect(reactionOf(table, 2)).toBe(null);
});

test("what is not known is NaN, in a column as long as the others", () => {
  for (const { values } of outcomeFeatures(table)) expect(values).toHaveLength(6);
  expect(outcomeFeatures(table).find(({ key }) => key === "ttc")!.values).toEqual(new Float64Array(6).fill(NaN));
});

test("scene parameters are those of one family", () => {
  expect([...sceneFeatures(table, "low")[0]!.values]).toEqual([0, NaN, 0.2, NaN, 0.4, NaN]);
  expect(sceneFeatures(table, "mixed")).toEqual([]);
  expect(sceneFeatures(table, "constructor")).toEqual([]);
});

test("names end with their unit", () => {
  expect(withUnit("lead_speed_mps")).toEqual(["lead speed", "m/s"]);
  expect(withUnit("lead_gap_m")).toEqual(["lead gap", "m"]);
  expect(withUnit("friction")).toEqual(["friction", ""]);
});
