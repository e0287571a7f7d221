import { expect, it } from "vitest";
import { queue } from "../../api/turn";
import { matching, titleOf } from "./listed";

const row = (name: string, summary: string, ...tags: string[]) => ({ name, summary, tags, actors: ["truck"] });
const ITEMS = [row("low", "Motorway: a leader brakes.", "iso34502:deceleration"), row("ramp_merge_0123456789ab", "An on-ramp.", "night")];

it("a title is the name in words, without its digest", () => {
  expect(titleOf("ramp_merge_0123456789ab")).toBe("Ramp merge");
  expect(titleOf("left_turn_car")).toBe("Left turn car");
});

it.each<[string, string[]]>([
  ["", ["low", "ramp_merge_0123456789ab"]],
  ["RAMP night", ["ramp_merge_0123456789ab"]],
  ["deceleration", ["low"]],
  ["truck", ["low", "ramp_merge_0123456789ab"]],
  ["ramp brakes", []],
])("search for %j", (text, names) => expect(matching(ITEMS, text).map(({ name }) => name)).toEqual(names));

it("a queue begins one act after the other, also after a failure", async () => {
  const turn = queue();
  const began: number[] = [];
  let end = () => {};
  const first = turn(() => new Promise<void>((_, reject) => (began.push(1), (end = () => reject(new Error("no"))))));
  const second = turn(async () => void began.push(2));
  await Promise.resolve();
  expect(began).toEqual([1]);
  end();
  await expect(first).rejects.toThrow("no");
  await second;
  expect(began).toEqual([1, 2]);
});
