import { expect, test } from "vitest";
import { niceEnd, percentAlong } from "./scale";

test.each([
  [0, 1], [0.0249, 0.025], [0.11, 0.2], [0.25, 0.25], [0.3, 0.5], [0.9, 1], [1, 1], [7, 10], [43, 50], [NaN, 1], [-1, 1],
])("an axis for %f ends at %f", (most, end) => expect(niceEnd(most)).toBe(end));

test("values lie on the axis, and those outside at its ends", () => {
  expect([-2, -1, 0, 1, 3].map((value) => percentAlong(value, -1, 1))).toEqual([0, 0, 50, 100, 100]);
  expect(percentAlong(1, 1, 1)).toBe(0);
});
