import { expect, test } from "vitest";
import { drive, drivenAt, drivenSoFar, shares, warmUp, type Driven } from "./driven";

const warmed = { episodes: [1, 2, 3, 5], driven_by: { script: [1, 2, 2, 3], policy: [0, 0, 1, 2] } };

test("a warm-up ends with the policy's first episode", () => {
  expect(warmUp(warmed)).toBe(2);
  expect(warmUp({ episodes: [2, 5], driven_by: { script: [2, 4], policy: [0, 1] } })).toBe(4);
  expect(warmUp({ episodes: [1, 2], driven_by: { policy: [1, 2] } })).toBe(0);
  expect(warmUp({ episodes: [1, 2], driven_by: { script: [1, 2] } })).toBe(0);
  expect(warmUp({ episodes: [1, 2], driven_by: {} })).toBe(0);
});

test("shares lie on each other between two points", () => {
  expect(shares(warmed)).toEqual([
    ["script", "M0 0H1V1H0ZM1 0H2V1H1ZM3 0.5H5V1H3Z"],
    ["policy", "M2 0H3V1H2ZM3 0H5V0.5H3Z"],
  ]);
});

test("each new episode counts for what drove it, and for nothing where that is not known", () => {
  const driven: Driven = {};
  (["random", "script", null, "script"] as const).forEach((by, at) => drive(driven, at, by));
  expect(driven).toEqual({ random: [1, 1, 1, 1], script: [0, 1, 1, 2] });
  drive(driven, 3, "policy"); // the newest point moves along
  expect(driven).toEqual({ random: [1, 1, 1, 1], script: [0, 1, 1, 2], policy: [0, 0, 0, 1] });
  expect(drivenSoFar(driven)).toEqual({ random: 1, script: 2, policy: 1 });
  expect(drivenAt(driven, [1, 3])).toEqual({ random: [1, 1], script: [1, 2], policy: [0, 1] });
});
