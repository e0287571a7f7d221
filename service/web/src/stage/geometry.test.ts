import { describe, expect, it } from "vitest";
import { boundsOf, corners, entry, roundLength, shadow } from "./geometry";

const box = (x: number, y: number, heading: number, length: number, width: number) => {
  const into = new Float64Array(8);
  corners(x, y, heading, length, width, into);
  return into;
};
const near = (values: Float64Array, wanted: number[]) => wanted.forEach((value, k) => expect(values[k]).toBeCloseTo(value));

describe("corners", () => {
  it("go counter-clockwise from the front left", () => {
    near(box(10, 5, 0, 4, 2), [12, 6, 8, 6, 8, 4, 12, 4]);
    near(box(10, 5, Math.PI / 2, 4, 2), [9, 7, 9, 3, 11, 3, 11, 7]);
  });
});

describe("shadow", () => {
  const into = new Float64Array(8);
  it("lies behind the outermost corners", () => {
    expect(shadow(0, 0, box(10, 0, 0, 4, 2), 20, into)).toBe(true);
    near(into.subarray(0, 2), [8, -1]); // the right one of the face that looks at the eye
    near(into.subarray(6, 8), [8, 1]);
    expect(Math.hypot(into[2]!, into[3]!)).toBeCloseTo(20);
    expect(into[3]! / into[2]!).toBeCloseTo(-1 / 8);
    expect(into[5]! / into[4]!).toBeCloseTo(1 / 8);
  });
  it("turns the same way round wherever the body is", () => {
    for (const angle of [0, 1, 2, 3, 4, 5, 6]) {
      expect(shadow(1, 2, box(1 + 9 * Math.cos(angle), 2 + 9 * Math.sin(angle), 1.1, 4, 2), 50, into)).toBe(true);
      let area = 0;
      for (let k = 0; k < 4; k++) area += into[2 * k]! * into[(2 * k + 3) % 8]! - into[(2 * k + 2) % 8]! * into[2 * k + 1]!;
      expect(area).toBeGreaterThan(0);
    }
  });
  it("is none around the eye", () => {
    expect(shadow(0, 0, box(0, 0, 0, 4, 2), 20, into)).toBe(false);
    expect(shadow(0, 0, box(0, 1.5, 0, 40, 2), 20, into)).toBe(true);
  });
});

describe("entry", () => {
  it("is the share of the way up to the body", () => {
    expect(entry(0, 0, 20, 0, 10, 0, 0, 4, 2)).toBeCloseTo(0.4);
    expect(entry(0, 0, 0, -20, 0, -10, Math.PI / 2, 4, 2)).toBeCloseTo(0.4);
  });
  it("is the whole way where the body stands aside, behind or farther on", () => {
    expect(entry(0, 0, 20, 0, 10, 5, 0, 4, 2)).toBe(1);
    expect(entry(0, 0, 20, 0, -10, 0, 0, 4, 2)).toBe(1);
    expect(entry(0, 0, 20, 0, 30, 0, 0, 4, 2)).toBe(1);
  });
});

it("boundsOf leaves out who is absent", () => {
  expect(boundsOf([])).toBeNull();
  expect(boundsOf([[1, 2], [Number.NaN, 0], [-1, 5]])).toEqual({ left: -1, right: 1, bottom: 2, top: 5 });
});

it("roundLength is the largest of 1, 2, 5 that fits", () => {
  expect([1, 1.9, 2, 4.9, 5, 9.9, 10, 37, 0.7].map(roundLength)).toEqual([1, 1, 2, 2, 5, 5, 10, 20, 0.5]);
});
