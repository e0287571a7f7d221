import { describe, expect, it } from "vitest";
import { apart, hull, moved, scaleOf, share, snapped } from "./range";

describe("a scale", () => {
  it.each([
    [0, 16.67, 0.2],
    [0.6, 1, 0.005],
    [100, 2000, 20],
    [-8, 3.5, 0.2],
    [0, 1, 0.01],
  ])("from %d to %d has about a hundred round steps", (low, high, step) => expect(scaleOf({ low, high }).step).toBe(step));

  it("counts where the field does, and survives a single value", () => {
    expect(scaleOf({ low: 2, high: 3 }, true).step).toBe(1);
    expect(scaleOf({ low: 3, high: 3 }).step).toBe(1);
  });

  it("snaps to its steps, but reaches its own ends", () => {
    const scale = scaleOf({ low: 0.13, high: 16.67 });
    expect(snapped(3.29, scale)).toBe(3.2);
    expect(snapped(0.14, scale)).toBe(0.2);
    expect(snapped(-5, scale)).toBe(0.13);
    expect(snapped(99, scale)).toBe(16.67);
    expect(snapped(0.3, scaleOf({ low: 0, high: 10 }))).toBe(0.3); // and not 0.30000000000000004
  });
});

describe("two thumbs", () => {
  const scale = { low: 0, high: 10, step: 1 };

  it("move one end each", () => {
    expect(moved({ low: 2, high: 8 }, "low", 4, scale)).toEqual({ low: 4, high: 8 });
    expect(moved({ low: 2, high: 8 }, "high", 4, scale)).toEqual({ low: 2, high: 4 });
  });

  it("meet, and never pass each other", () => {
    expect(moved({ low: 2, high: 8 }, "low", 9, scale)).toEqual({ low: 8, high: 8 });
    expect(moved({ low: 2, high: 8 }, "high", -3, scale)).toEqual({ low: 2, high: 2 });
  });
});

it("a share of a scale without extent is nothing, and never infinite", () => {
  expect(share(3, { low: 3, high: 3 })).toBe(0);
  expect(share(5, { low: 0, high: 10 })).toBe(0.5);
  expect(share(50, { low: 0, high: 10 })).toBe(1);
});

it("the hull holds all ranges; ranges that touch are not apart", () => {
  expect(hull([{ low: 2, high: 3 }, { low: 0, high: 1 }])).toEqual({ low: 0, high: 3 });
  expect(apart({ low: 0, high: 1 }, { low: 1, high: 2 })).toBe(false);
  expect(apart({ low: 0, high: 1 }, { low: 1.1, high: 2 })).toBe(true);
});
