import { expect, it } from "vitest";
import { boxesIn, changeOf, drawnIn, kindsOf, nameOf, spots, type Point, type Row } from "./points";

function point(version: string, told: Partial<Point> = {}): Point {
  const rest = { registered: null, settings: [], campaign_id: version, at: null, earlier: [], software: { definitions: "10" }, changed: [], headline: 0, headline_published: 0 };
  return { version, ...rest, kinds: [], new: null, gone: null, returned: null, requirements: {}, rates: [], areas: [], ...told };
}

const CHANGED = point("1.5", { software: { definitions: "11" }, changed: ["definitions"], headline: null, kinds: null });

it("names a version with the settings that differ", () => {
  expect(nameOf(point("1.4"))).toBe("1.4");
  expect(nameOf(point("1.4", { settings: ["defects blind-right", "reaction_time_s 1"] }))).toBe("1.4 (defects blind-right; reaction_time_s 1)");
});

it("says what changed between two versions", () => {
  expect(changeOf([point("1.4"), CHANGED], 1)).toBe("definitions 10 → 11");
  expect(changeOf([point("1.4"), CHANGED], 0)).toBe("");
});

it("draws counts without an interval, rates with one, and nothing where a value is unknown", () => {
  const points = [point("1.4", { headline: 3 }), CHANGED];
  expect(spots(points, ({ headline }) => headline)).toEqual([
    { version: "1.4", value: 3, low: null, high: null, change: "" },
    { version: "1.5", value: null, low: null, high: null, change: "definitions 10 → 11" },
  ]);
  expect(spots(points.slice(0, 1), () => ({ rate: 0.1, low: 0.05, high: 0.2 }))).toEqual([{ version: "1.4", value: 0.1, low: 0.05, high: 0.2, change: "" }]);
});

it("says what became of each kind in each version", () => {
  const points = [
    point("1.3", { kinds: ["a", "b"] }),
    point("1.4", { kinds: ["b", "c"], new: ["c"], gone: ["a"], returned: [] }),
    point("1.5", { kinds: ["a", "c"], new: [], gone: ["b"], returned: ["a"] }),
  ];
  expect(Object.fromEntries(kindsOf({ points } as Row))).toEqual({
    a: ["found", "gone", "returned"],
    b: ["found", "found", "gone"],
    c: ["absent", "new", "found"],
  });
});

it("lists scenario and traffic once", () => {
  const rate = { family: "low", method: "iid-random", requirement: null, count: 1, played: 10, rate: 0.1, low: 0, high: 0.3 };
  const rates = [rate, { ...rate, requirement: "no_contact" }, { ...rate, method: "iid-undisturbed" }];
  expect(drawnIn({ points: [point("1.3", { rates }), point("1.4", { rates })] } as Row)).toEqual(["low, random adversaries", "low, undisturbed traffic"]);
});

it("lists boxes of scene parameters once", () => {
  const area = { family: "cut_in", parameters: ["gap_m", "speed_mps"], driver: "r157", rate: 0.2, low: 0.1, high: 0.3 };
  expect(boxesIn({ points: [point("1.3", { areas: [area] }), point("1.4", { areas: [area] })] } as Row)).toEqual(["Gap and Speed in cut in: only the ego fails, not R157's driver"]);
});
