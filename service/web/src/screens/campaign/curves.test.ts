import { describe, expect, test } from "vitest";
import { extend, halve, LiveCurves, POINTS, Sliding, trailing, WINDOW, type Curve, type Point } from "./curves";

function curve(episodes: number[] = [], mean_cost: number[] = []): Curve {
  const known = (value: number) => episodes.map(() => value);
  return {
    run_id: "low-random-1", family: "low", method: "random", seed: 1, state: "running",
    episodes, mean_cost, window_ecr: known(0.1), window_pcr: known(0), distinct: [...episodes],
    distinct_preventable: known(0), dual_variable: known(0.2), driven_by: { script: [...episodes] },
  };
}

function point(episodes: number, mean_cost: number | null = 0): Point {
  return { episodes, mean_cost, window_ecr: 0.5, window_pcr: 0.25, distinct: episodes, distinct_preventable: 1, dual_variable: 0.3, driven_by: "policy" };
}

function told(index: number, more: object = {}) {
  const episode = {
    run_id: "low-random-1", phase: "search", index, outcome: "no_failure", collision: null, mean_cost: 0.5, steps: 80, dual_variable: 0.4, driven_by: "policy",
    funnel: { contacts: 9, valid: 8, distinct: 7, preventable: 6 }, ...more,
  };
  return { id: `${index}`, event: "episode", data: JSON.stringify(episode) };
}

describe("a sliding rate", () => {
  test("of a young run is over the episodes there are", () => {
    const sliding = new Sliding();
    expect(sliding.rate("valid")).toBeNull();
    sliding.add(1, true, false);
    sliding.add(2, false, false);
    expect([sliding.rate("valid"), sliding.rate("preventable")]).toEqual([0.5, 0]);
  });

  test("of an old run is unknown until the whole window was heard", () => {
    const sliding = new Sliding();
    for (let n = 501; n < 500 + WINDOW; n++) sliding.add(n, true, true);
    expect(sliding.rate("valid")).toBeNull();
    sliding.add(500 + WINDOW, false, false);
    expect(sliding.rate("valid")).toBe(0.99);
    sliding.add(501 + WINDOW, false, false);
    expect(sliding.rate("preventable")).toBe(0.98);
  });

  test("does not count an episode twice, and begins anew behind a gap", () => {
    const sliding = new Sliding();
    sliding.add(1, true, false);
    sliding.add(1, true, false);
    sliding.add(2, false, false);
    expect(sliding.rate("valid")).toBe(0.5);
    sliding.add(4, true, false);
    expect(sliding.rate("valid")).toBeNull();
  });
});

describe("a growing curve", () => {
  test("takes what is new and leaves what it has", () => {
    const grown = curve([1, 2], [0, 1]);
    extend(grown, point(2));
    extend(grown, point(3, 0.5));
    expect(grown.episodes).toEqual([1, 2, 3]);
    expect(grown.mean_cost).toEqual([0, 1, 0.5]);
    expect(grown.window_ecr).toEqual([0.1, 0.1, 0.5]);
    expect(grown.driven_by).toEqual({ script: [1, 2, 2], policy: [0, 0, 1] });
  });

  test("moves its newest point along while the search is long, with the mean cost of all since the one before", () => {
    const grown = curve([996, 999], [0, 0.9]);
    extend(grown, point(1000, 0.3));
    expect(grown.episodes).toEqual([996, 1000]);
    expect(grown.mean_cost[1]).toBeCloseTo((3 * 0.9 + 0.3) / 4);
    extend(grown, point(1002, 0));
    expect(grown.episodes).toEqual([996, 1000, 1002]);
  });

  test("stays short however long the search is, and ends with the newest episode", () => {
    const grown = curve();
    for (let n = 1; n <= 30_000; n++) {
      extend(grown, point(n, n % 2));
      expect(grown.episodes.length).toBeLessThanOrEqual(2 * POINTS);
    }
    expect(grown.episodes.at(-1)).toBe(30_000);
    const gaps = grown.episodes.map((n, at) => n - (grown.episodes[at - 1] ?? 0));
    const sum = grown.mean_cost.reduce<number>((total, mean, at) => total + mean! * gaps[at]!, 0);
    expect(sum).toBeCloseTo(15_000); // no cost is lost or counted twice
  });

  test("halved keeps the newest point and every column as long as another", () => {
    for (const length of [4, 5]) {
      const halved = curve(Array.from({ length }, (_, at) => at + 1), Array.from({ length }, (_, at) => at));
      halve(halved);
      expect(halved.episodes).toEqual(length === 4 ? [2, 4] : [1, 3, 5]);
      expect(halved.mean_cost).toEqual(length === 4 ? [0.5, 2.5] : [0, 1.5, 3.5]);
      expect(halved.distinct).toEqual(halved.episodes);
      expect(halved.driven_by).toEqual({ script: halved.episodes });
    }
  });
});

test("a trailing mean weighs points by their episodes, and forgets what lies too far back", () => {
  expect(trailing([1, 2, 4], [1, 0, 0.5], 10)).toEqual([1, 0.5, 0.5]);
  expect(trailing([1, 2, 3, 4], [1, 0, 1, 0], 2)).toEqual([1, 0.5, 0.5, 0.5]);
  expect(trailing([1, 2], [null, 0.4], 10)).toEqual([null, 0.4]);
});

test("events go on where the snapshot ends; those before it fill the window alone", () => {
  const live = new LiveCurves([curve([1, 2], [0, 0])]);
  const failed = { outcome: "failure", collision: { verdicts: {}, judgement: { grade: "preventable" } } };
  live.apply([told(0), told(1, failed), told(2), { id: "s", event: "state", data: "{}" }, told(3, { phase: "evaluation" })]);
  expect(live.runs[0]).toMatchObject({ episodes: [1, 2, 3], distinct: [1, 2, 7], dual_variable: [0.2, 0.2, 0.4], mean_cost: [0, 0, 0.5], driven_by: { policy: [0, 0, 1] } });
  expect(live.runs[0]!.window_ecr[2]).toBeCloseTo(1 / 3);
  expect(live.runs[0]!.window_pcr[2]).toBeCloseTo(1 / 3);
});

test("an event of a run that the snapshot lacks is passed over", () => {
  const live = new LiveCurves([]);
  live.apply([told(0)]);
  expect(live.runs).toEqual([]);
});
