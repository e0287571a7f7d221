import { expect, test } from "vitest";
import { brushed, parsed, rounded, within, written } from "./brushes";
import { outcomeFeatures, sceneFeatures } from "./features";
import { sample } from "./sample";

const table = sample(20);
const features = [...outcomeFeatures(table), ...sceneFeatures(table, "low")];
const all = table.ids.map((_, i) => i);

test("brushes survive the address", () => {
  const text = "closing:5:12.5,scene.friction::0.8,robustness:-0.5:";
  expect(written(parsed(text))).toBe(text);
});

test("what cannot be read, or is open at both ends, is no brush", () => {
  expect(parsed("").size).toBe(0);
  expect(parsed("closing,closing:,closing::,:1:2,closing:x:y").size).toBe(0);
});

test("both ends of a brush belong to it", () => {
  const closing = new Map([["closing", [3, 7] as const]]);
  for (const i of all) {
    const inside = table.relative_speed_mps[i]! >= 3 && table.relative_speed_mps[i]! <= 7;
    expect(within(all, closing, features).includes(i)).toBe(inside);
  }
});

test("who has no value on a brushed axis is left out", () => {
  expect(within(all, parsed("scene.friction:0:"), features)).toEqual(all.filter((i) => i % 2 === 0));
  expect(within(all, parsed("reaction::100"), features)).not.toContain(2);
});

test("brushes add up, and a brush of an axis that is not there hides nobody", () => {
  const both = within(all, parsed("closing:5:,scene.friction::0.8"), features);
  expect(both).toEqual(all.filter((i) => i % 2 === 0 && i / 10 <= 0.8 && table.relative_speed_mps[i]! >= 5));
  expect(within(all, parsed("nothing:1:2"), features)).toEqual(all);
});

test("a brush is taken back by null or by opening both ends", () => {
  const one = brushed(new Map(), "closing", [1, 2]);
  expect(brushed(one, "closing", null).size).toBe(0);
  expect(brushed(one, "closing", [-Infinity, Infinity]).size).toBe(0);
  expect(one.size).toBe(1);
});

test("a dragged interval is in order, and as exact as its axis", () => {
  expect(rounded([7.123456, 2.98765], 10)).toEqual([2.99, 7.12]);
  expect(rounded([0.123456, 0.5], 0.5)).toEqual([0.123, 0.5]);
});
