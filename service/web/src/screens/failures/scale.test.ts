import { expect, test } from "vitest";
import { domain, linear, ticks, tickText } from "./scale";

test("a scale and its inverse agree, also upside down", () => {
  const scale = linear(2, 12, 200, 0);
  expect([2, 7, 12].map(scale.at)).toEqual([200, 100, 0]);
  expect([200, 100, 0].map(scale.of)).toEqual([2, 7, 12]);
});

test("a domain is round, holds every number and passes over what is none", () => {
  expect(domain([0.13, 9.2, NaN])).toEqual([0, 10]);
  expect(domain([-0.41, 0.2]).map((each) => +each.toFixed(9))).toEqual([-0.5, 0.2]); // 0.61 in steps of 0.1
  for (const seed of [1, 2, 3]) {
    const values = Array.from({ length: 50 }, (_, i) => Math.sin(i * seed) * 10 ** (seed - 2));
    const [low, high] = domain(values);
    expect(low).toBeLessThanOrEqual(Math.min(...values));
    expect(high).toBeGreaterThanOrEqual(Math.max(...values));
  }
});

test("a domain of one value, or of none, is still wide", () => {
  expect(domain([3, 3])).toEqual([2.5, 3.5]);
  expect(domain([])).toEqual([0, 1]);
  expect(domain([NaN])).toEqual([0, 1]);
});

test("ticks are round and lie inside", () => {
  expect(ticks(0, 10, 5)).toEqual([0, 2, 4, 6, 8, 10]);
  expect(ticks(-0.25, 0.25, 5).map((each) => +each.toFixed(9))).toEqual([-0.2, -0.1, 0, 0.1, 0.2]);
});

test("a tick has as many digits as tell it from the next", () => {
  expect(tickText(0.2, 0, 1, 5)).toBe("0.2");
  expect(tickText(20, 0, 100, 5)).toBe("20");
  expect(tickText(-0.05, -0.1, 0.1, 4)).toBe("−0.05");
  expect(tickText(-1e-17, -1, 1, 4)).toBe("0.0");
});
