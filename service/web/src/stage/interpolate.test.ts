import { describe, expect, it } from "vitest";
import { instantAt, posesAt, turned, velocityAt } from "./interpolate";
import type { Collision } from "../ui/violations";
import { hiddenSpans, recordingOf, type Series } from "./recording";

const TIMES = [-0.3, -0.2, -0.1, 0];

/** An ego that drives east and turns over the seam of headings, and a pedestrian that comes later. */
export function recording() {
  const series = {
    time_s: [1, 1.1, 1.2],
    released_s: 1,
    ids: ["ego", "ped"],
    kind: ["vehicle", "pedestrian"],
    body: ["car", "pedestrian"],
    role: ["ego", "adversary"],
    length_m: [4, 0.5],
    width_m: [2, 0.5],
    x_m: [[0, null], [1, 5], [3, 5]],
    y_m: [[0, null], [0, 2], [0, 1]],
    heading_rad: [[3.1, null], [-3.1, 0], [-3, 0]],
    visible: [[null, false], [null, false], [null, true]],
  } as unknown as Series;
  const collision = { time_s: 0.2, other_id: "ped", judgement: { conflict_s: 0.1 } } as unknown as Collision;
  return recordingOf(series, collision);
}

describe("instantAt", () => {
  it("is the frame itself at a frame, whatever the rounding", () => {
    TIMES.forEach((time, index) => expect(instantAt(TIMES, time)).toEqual({ index, share: 0 }));
    expect(instantAt(TIMES, -0.1 - 1e-9)).toEqual({ index: 2, share: 0 });
    expect(instantAt(TIMES, -0.1 + 1e-9)).toEqual({ index: 2, share: 0 });
  });
  it("is a share of the way between frames", () => {
    const { index, share } = instantAt(TIMES, -0.175);
    expect(index).toBe(1);
    expect(share).toBeCloseTo(0.25);
  });
  it("stays at the ends beyond them, and without a number", () => {
    expect(instantAt(TIMES, -9)).toEqual({ index: 0, share: 0 });
    expect(instantAt(TIMES, 9)).toEqual({ index: 3, share: 0 });
    expect(instantAt(TIMES, Number.NaN)).toEqual({ index: 0, share: 0 });
    expect(instantAt([], 0)).toEqual({ index: 0, share: 0 });
  });
});

describe("turned", () => {
  it("takes the shorter turn, also over the seam", () => {
    expect(turned(0, 1, 0.5)).toBeCloseTo(0.5);
    expect(Math.cos(turned(3.1, -3.1, 0.5))).toBeCloseTo(-1);
    expect(Math.cos(turned(-3.1, 3.1, 0.5))).toBeCloseTo(-1);
    expect(turned(0, 2 * Math.PI, 0.5)).toBeCloseTo(0);
  });
});

describe("posesAt", () => {
  it("is the series at frames, and between them on the straight line", () => {
    const poses = new Float64Array(6);
    posesAt(recording(), { index: 1, share: 0 }, poses);
    expect([...poses]).toEqual([1, 0, -3.1, 5, 2, 0]);
    posesAt(recording(), { index: 1, share: 0.5 }, poses);
    expect([...poses].map((value) => Math.round(value * 1e6) / 1e6)).toEqual([2, 0, -3.05, 5, 1.5, 0]);
  });
  it("shows nobody who is absent", () => {
    const poses = new Float64Array(6);
    posesAt(recording(), { index: 0, share: 0.5 }, poses);
    expect(poses[0]).toBe(0.5);
    expect(poses[3]).toBeNaN();
  });
});

describe("velocityAt", () => {
  it("is that of the step which leads to the time", () => {
    expect(velocityAt(recording(), { index: 2, share: 0 }, 0)[0]).toBeCloseTo(20);
    expect(velocityAt(recording(), { index: 1, share: 0 }, 0)[0]).toBeCloseTo(10);
    expect(velocityAt(recording(), { index: 1, share: 0.3 }, 1)[1]).toBeCloseTo(-10);
    expect(velocityAt(recording(), { index: 0, share: 0 }, 1)[0]).toBeNaN();
  });
});

describe("recordingOf", () => {
  it("counts time from the contact and names the striker", () => {
    const made = recording();
    [-0.2, -0.1, 0].forEach((time, step) => expect(made.time_s[step]).toBeCloseTo(time));
    expect(made.parts).toEqual(["ego", "striker"]);
    expect(made.released_s).toBeCloseTo(-0.2);
    expect(made.conflict_s).toBeCloseTo(-0.1);
  });
  it("has the spans in which the striker is hidden", () => {
    const [[from, to]] = hiddenSpans(recording(), 1) as [[number, number]];
    expect(from).toBeCloseTo(-0.2);
    expect(to).toBeCloseTo(0);
  });
});
