import { expect, it } from "vitest";
import { begin, matching, packagingOf, type Spot } from "./places";

const SPOTS: Spot[] = [
  { pattern: "junction", place: "-1#0", x_m: 0, y_m: 0, summary: "Junction 'A' from '-1#0': who comes from the left crosses.", rare: false },
  { pattern: "crossing", place: "2&b", x_m: 1, y_m: 2, why: "'2&b' leads nowhere" },
];

it.each([
  [[0x1f, 0x8b, 8], "application/gzip"],
  [[0x50, 0x4b, 3, 4], "application/zip"],
  [[0x3c, 0x6e], "application/xml"],
  [[], "application/xml"],
])("an upload that begins with %j is %s", (start, wanted) => expect(packagingOf(new Uint8Array(start))).toBe(wanted));

it("places are found by pattern and by what is said of them", () => {
  expect(matching(SPOTS, "", "")).toEqual(SPOTS);
  expect(matching(SPOTS, "crossing", "")).toEqual([SPOTS[1]]);
  expect(matching(SPOTS, "", " LEFT ")).toEqual([SPOTS[0]]);
  expect(matching(SPOTS, "crossing", "left")).toEqual([]);
});

it("a campaign begins at a place, whatever it is called, or at all", () => {
  expect(begin("n1", "crossing", "2&b")).toBe("#/new?network=n1&pattern=crossing&place=2%26b");
  expect(begin("n1", "junction", null)).toBe("#/new?network=n1&pattern=junction&places=all");
});
