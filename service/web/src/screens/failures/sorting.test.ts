import { expect, test } from "vitest";
import { foundOf } from "./found";
import { sample } from "./sample";
import { oneEach, sorted, SORTS, type Sort } from "./sorting";
import type { FailureTable } from "./wire";

const oftenOf = (some: FailureTable) => foundOf(some, "variant").map(({ episodes }) => episodes);

const table = sample(12);
const all = table.ids.map((_, i) => i);
const by = (sort: Sort) => sorted(table, all, sort, oftenOf(table));

test("every order holds every failure once", () => {
  for (const sort of Object.keys(SORTS) as Sort[]) expect([...by(sort)].sort((a, b) => a - b)).toEqual(all);
});

test("preventable ones come first, among them the fastest", () => {
  expect(by("grade").map((i) => table.grade[i])).toEqual([
    ...["preventable", "preventable", "preventable"],
    ...["full_braking", "full_braking", "full_braking"],
    ...["unavoidable", "unavoidable", "unavoidable"],
    ...[null, null, null],
  ]);
  const closing = by("grade").slice(0, 3).map((i) => table.relative_speed_mps[i]!);
  expect(closing).toEqual([...closing].sort((a, b) => b - a));
});

test("of equal grades the severe come first, and of those the ego's fault", () => {
  const severity = (["minor", null, "moderate", "severe", "severe", "severe"] as const).slice();
  const fault = (["ego", "ego", "ego", "other", null, "ego"] as const).slice();
  const few = sample(6, { grade: Array(6).fill("preventable"), severity, fault });
  const order = sorted(few, [0, 1, 2, 3, 4, 5], "grade", oftenOf(few));
  expect(order).toEqual([5, 3, 4, 2, 1, 0]); // what touched nothing, 1, is no minor contact
});

test("by severity the severe come first, then the ego's fault, then the preventable", () => {
  const severity = (["minor", "severe", "severe", "severe"] as const).slice();
  const fault = (["ego", "other", "ego", "other"] as const).slice();
  const grade = (["preventable", "unavoidable", "unavoidable", "preventable"] as const).slice();
  const few = sample(4, { grade, severity, fault });
  expect(sorted(few, [0, 1, 2, 3], "severity", oftenOf(few))).toEqual([2, 3, 1, 0]);
});

test("a likely moderate failure comes before an unlikely severe one", () => {
  const severity = (["severe", "moderate"] as const).slice();
  const few = sample(2, { severity, plausibility: Array(2).fill("rare"), weight: [0.001, 0.05] });
  expect(sorted(few, [0, 1], "severity", oftenOf(few))).toEqual([1, 0]);
});

test("implausible failures come last, however severe", () => {
  const plausibility = (["implausible", "rare", "ordinary"] as const).slice();
  const severity = (["severe", "severe", "moderate"] as const).slice();
  const few = sample(3, { plausibility, severity, fault: Array(3).fill("ego") });
  expect(sorted(few, [0, 1, 2], "severity", oftenOf(few))).toEqual([1, 2, 0]);
});

test("a variant is shown by its headline episode, else by its worst", () => {
  const severity = (["minor", "severe", "moderate", "severe"] as const).slice();
  const few = sample(4, { severity, variant: [0, 0, 1, 1], headline: [false, false, true, false] });
  expect(oneEach(few, [0, 1, 2, 3], oftenOf(few), few.variant).sort()).toEqual([1, 2]);
  expect(oneEach(few, [0, 3], oftenOf(few), few.variant).sort()).toEqual([0, 3]);
});

test("who has no time to contact comes last", () => {
  expect(by("reaction").slice(0, 3)).toEqual([0, 1, 3]);
  expect(by("reaction").at(-1)).toBe(2);
});

test("fastest, newest, most frequent", () => {
  expect(table.relative_speed_mps[by("closing")[0]!]).toBe(9);
  expect(by("newest").slice(0, 2)).toEqual([11, 10]);
  expect(sorted(table, [3, 9, 1], "newest", oftenOf(table))).toEqual([9, 3, 1]); // whatever the order before
  const often = oftenOf(table);
  expect(often[by("often")[0]!]).toBe(Math.max(...often));
  expect(often[by("rare")[0]!]).toBe(1);
});
