import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { advanced, Clock, RATES, stepped } from "./clock";

const TIMES = [-0.3, -0.2, -0.1, 0];

describe("advanced", () => {
  it("goes by the wall clock and the rate, up to the end", () => {
    expect(advanced(-1, 16, 1, 0)).toBeCloseTo(-0.984);
    expect(advanced(-1, 16, 0.1, 0)).toBeCloseTo(-0.9984);
    expect(advanced(-0.01, 16, 4, 0)).toBe(0);
  });
  it("does not jump after a pause of the tab", () => expect(advanced(-9, 60_000, 1, 0)).toBeCloseTo(-8.9));
});

describe("stepped", () => {
  it("goes from frame to frame and stays at the ends", () => {
    expect(stepped(TIMES, -0.2, 1)).toBe(-0.1);
    expect(stepped(TIMES, -0.2, -1)).toBe(-0.3);
    expect(stepped(TIMES, -0.3, -1)).toBe(-0.3);
    expect(stepped(TIMES, 0, 1)).toBe(0);
  });
  it("lands on the neighbouring frames from between two", () => {
    expect(stepped(TIMES, -0.17, 1)).toBe(-0.1);
    expect(stepped(TIMES, -0.17, -1)).toBe(-0.2);
  });
});

describe("Clock", () => {
  let tick: ((now: number) => void) | null;
  beforeEach(() => {
    tick = null;
    vi.stubGlobal("requestAnimationFrame", (callback: (now: number) => void) => ((tick = callback), 1));
    vi.stubGlobal("cancelAnimationFrame", () => (tick = null));
    vi.spyOn(performance, "now").mockReturnValue(1000);
  });
  afterEach(() => {
    vi.unstubAllGlobals();
    vi.restoreAllMocks();
  });

  it("stays within the recording", () => {
    const clock = new Clock(TIMES, -7);
    expect(clock.time.get()).toBe(-0.3);
    clock.seek(5);
    expect(clock.time.get()).toBe(0);
    clock.seek(Number.NaN);
    expect(clock.time.get()).toBe(0);
  });
  it("plays to the end, stops there, and then begins anew", () => {
    const clock = new Clock(TIMES, -0.05);
    clock.play();
    tick!(1020);
    expect(clock.time.get()).toBeCloseTo(-0.03);
    tick!(1100);
    expect(clock.time.get()).toBe(0);
    expect(clock.playing.get()).toBe(false);
    clock.toggle();
    expect(clock.time.get()).toBe(-0.3);
    expect(clock.playing.get()).toBe(true);
  });
  it("stops for a step", () => {
    const clock = new Clock(TIMES, -0.25);
    clock.play();
    clock.step(1);
    expect([clock.playing.get(), clock.time.get(), tick]).toEqual([false, -0.2, null]);
  });
  it("has rates from the slowest to the fastest", () => {
    const clock = new Clock(TIMES, 0);
    for (let k = 0; k < 9; k++) clock.pace(1);
    expect(clock.rate.get()).toBe(RATES.at(-1));
    for (let k = 0; k < 9; k++) clock.pace(-1);
    expect(clock.rate.get()).toBe(0.1);
  });
});
