import { expect, it } from "vitest";
import type { Listed } from "../campaigns/listed";
import type { Row } from "../trend/points";
import { bars, byEgo, newestRow } from "./egos";

const campaign = (id: string, driver: string | null) => ({ id, ego: { driver, profile: "default" } }) as Listed;
const row = (...ids: string[]) => ({ points: ids.map((campaign_id) => ({ campaign_id, earlier: [`${campaign_id}-old`] })) }) as unknown as Row;

it("groups campaigns by ego, the newest first", () => {
  const groups = byEgo([campaign("c", "mine"), campaign("b", null), campaign("a", "mine")]);
  expect(groups.map(({ name, campaigns }) => [name, campaigns.map(({ id }) => id)])).toEqual([
    ["mine", ["c", "a"]],
    ["default", ["b"]],
  ]);
});

it("follows the terms of the newest campaign that a row has", () => {
  const rows = [row("a", "b"), row("d")];
  expect(newestRow(rows, [campaign("running", null), campaign("d-old", null), campaign("a", null)])).toBe(rows[1]);
  expect(newestRow([], [campaign("a", null)])).toBeUndefined();
});

it("scales bars to the longest, and leaves out what is unknown", () => {
  expect(bars([{ headline: 4 }, { headline: 1 }, { headline: 0 }, { headline: null }])).toEqual([100, 25, 0, null]);
});
