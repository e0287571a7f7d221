import { expect, test } from "vitest";
import { csv, json, markdown, type Line } from "./export";

const nothing = { mean: null, low: null, high: null };
function line(label: string): Line {
  const row = {
    key: "c1 random", name: "random", mark: { colour: "--series-1" as const, dash: [] }, runs: 1, episodes: 40, rejected: 0,
    raw_collisions: 4, failures: 3, distinct_failures: 2, distinct_preventable: 1, distinct_published: 1, headline_candidates: 1, implausible: 0, headline: 1, headline_published: 0, requirements: {}, pcr_by_driver: {}, by_severity: {}, by_fault: {}, episodes_driven_by: {}, headline_driven_by: {},
    ecr: { mean: 0.075, low: 0.02, high: 0.2 }, pcr: nothing,
    more: {
      efficiency: nothing, cost_rate: nothing, dispersion: nothing, steps_per_distinct_failure: null, artefacts: 0,
      unresponsive_share: null, preventable: 0, environment_steps: 1,
    },
  };
  return { family: "low", campaign: "c1", label, row };
}

test("a line of CSV has all columns; an unknown value is empty", () => {
  expect(csv([line("a")]).split("\r\n")[1]).toBe("low,c1,a,random,1,1,0,40,4,3,2,1,1,0.075,0.02,0.2,,,");
});

test("labels cannot break out of their cell, nor become a formula", () => {
  expect(csv([line('=1,"2"')])).toContain(`,"'=1,""2""",`);
  expect(markdown([line("a|b\nc")]).split("\n")[2]).toBe("| low | c1 | a b c | random | 1 | 1 | 0 | 40 | 4 | 3 | 2 | 1 | 1 | 0.075 | 0.02 | 0.2 | – | – | – |");
});

test("JSON has the values as they are", () => {
  expect(JSON.parse(json([line("a")]))[0]).toMatchObject({ campaign: "c1", ecr: 0.075, pcr: null });
});
