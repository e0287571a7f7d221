import { describe, expect, it } from "vitest";
import { bodyOf } from "./body";
import { faultOf, inserted, pointed } from "./formula";
import { numbersOf, numbersText } from "./numbers";
import { applied, costOf, EFFORTS, isOf } from "./presets";
import type { Shape } from "./schema";
import { curl, quoted } from "./shell";
import { timesOf, timeWords } from "./times";

const measured = (name: string, episode_s: Record<string, number>, like: string | null = null) => ({ name, episode_s, like });

describe("numbers", () => {
  it.each<[string, number[] | null]>([
    ["0, 1, 2", [0, 1, 2]],
    ["0-2 7;9", [0, 1, 2, 7, 9]],
    ["64, 64", [64, 64]],
    ["", []],
    ["0-", null],
    ["5-3", null],
    ["0-99999999", null],
    ["a", null],
  ])("of %j", (text, wanted) => expect(numbersOf(text)).toEqual(wanted));

  it.each<[number[], string]>([
    [[0, 1, 2, 3], "0-3"],
    [[0, 1], "0, 1"],
    [[64, 64], "64, 64"],
    [[0, 1, 2, 7], "0-2, 7"],
    [[], ""],
  ])("of %j as a text, which reads back the same", (numbers, wanted) => {
    expect(numbersText(numbers)).toBe(wanted);
    expect(numbersOf(wanted)).toEqual(numbers);
  });
});

describe("a fault in a formula", () => {
  it("has the column and the reason of the service's message", () => {
    expect(faultOf("column 0: unknown character 'ß'")).toEqual({ column: 0, why: "unknown character 'ß'" });
    expect(faultOf("requirement 'a': column 16: '=' is not supported")).toEqual({ column: 16, why: "'=' is not supported" });
    expect(faultOf("String should have at least 1 character")).toEqual({ column: null, why: "String should have at least 1 character" });
  });

  it("has a caret under its column, also behind the last character", () => {
    expect(pointed("a >== 3", 4)).toBe("a >== 3\n    ^");
    expect(pointed("a >", 99)).toBe("a >\n   ^");
    expect(pointed("a\tb", 2)).toBe("a b\n  ^");
  });
});

it("a signal goes where the cursor is, with a gap where it needs one", () => {
  expect(inserted("not", "ttc_s", 3, 3)).toEqual(["not ttc_s", 9]);
  expect(inserted("(x)", "ttc_s", 1, 2)).toEqual(["(ttc_s)", 6]);
});

it("a shell takes any text for one word", () => {
  expect(quoted("it's $HOME `x`")).toBe(String.raw`'it'\''s $HOME ` + "`x`'");
  expect(curl("http://h/v1", "{}", true)).toBe(
    `curl 'http://h/v1' \\\n  -H "authorization: Bearer $RISK_SAC_KEY" \\\n  -H 'content-type: application/json' \\\n  -d '{}'`,
  );
});

it("a campaign costs what all its runs do", () => {
  const spec = { methods: ["random", "archive"], seeds: [0, 1, 2], budget: { episodes: 10, evaluation_episodes: 5 } };
  const time = timesOf([measured("low", { random: 0.1, archive: 0.05 }), measured("dense", { random: 0.4, archive: 0.2 })], {});
  const cost = costOf(spec, ["low", "dense"], time);
  expect(cost).toMatchObject({ runs: 12, episodes: 180 });
  expect(cost.seconds).toBeCloseTo(12 * 6 + 45 * (0.1 + 0.05 + 0.4 + 0.2));
});

it("an effort fills its time, whatever the number of scenarios", () => {
  const hour = EFFORTS.find(({ title }) => title === "An hour")!;
  const spec = { label: "kept", budget: { episodes: 1, cpu_s: null } };
  const time = timesOf([], {});
  for (const scenarios of [["dense"], Array<string>(10).fill("low"), Array<string>(17).fill("low")]) {
    const made = applied(hour, spec, scenarios, time);
    expect(costOf(made, scenarios, time).seconds).toBeGreaterThan(3000);
    expect(costOf(made, scenarios, time).seconds).toBeLessThanOrEqual(3600);
    expect(isOf(hour, made, scenarios, time)).toBe(true);
    expect(made.label).toBe("kept");
  }
});

it("every effort searches with the diverse method", () => {
  for (const { methods } of EFFORTS) expect(methods).toContain("risk-sac-diverse");
});

it("an ego is sent without what it has no use for", () => {
  const plain: Shape = { kind: "text", most: 99, pattern: "" };
  const field = (name: string, shape: Shape, preset?: string) => ({ name, shape, preset, optional: false, title: "", unit: "", about: "" });
  const ego: Shape = { kind: "object", about: "", fields: [field("profile", plain, "default"), field("reaction_time_s", plain, "0.5")] };
  const shape: Shape = { kind: "object", about: "", fields: [field("ego", ego)] };
  expect(bodyOf(shape, { ego: { profile: "perfect", reaction_time_s: "0.1" } })).toEqual({ ego: { profile: "perfect" } });
  expect(bodyOf(shape, { ego: { profile: "careful", reaction_time_s: "0.1", driver: "rss" } })).toEqual({});
  expect(bodyOf(shape, { ego: { profile: "careful", reaction_time_s: "0.1" } })).toEqual({ ego: { profile: "careful", reaction_time_s: "0.1" } });
});

describe("the time of an episode", () => {
  const costs = { random: 1, archive: 0.5, sac: 9, unknown: null };
  const time = timesOf([measured("low", { random: 0.2 }), measured("dense", { archive: 0.5 }), measured("mixed", {}), measured("mine", {}, "dense"), measured("other", {}, "mixed")], costs);

  it.each([
    ["low", "random", 0.2, "measured"],
    ["low", "archive", 0.1, "derived"],
    ["low", "sac", 0.2 + 8 * 0.2, "derived"],
    ["dense", "archive", 0.5, "measured"],
    ["dense", "random", 1, "derived"],
    ["dense", "sac", 1 + 8 * 0.2, "derived"],
    ["mine", "random", 1, "derived"],
    ["mixed", "unknown", 0.09, "reference"],
    ["other", "random", 0.09, "reference"],
    ["nowhere", "random", 0.1, "reference"],
  ] as const)("in %s of %s", (scenario, method, seconds, source) => {
    expect(time(scenario, method)).toEqual({ seconds: expect.closeTo(seconds) as number, source });
  });

  it("is told with where it comes from", () => {
    expect(timeWords(time, ["low", "low", "dense", "mixed"], ["random"])).toBe(
      "An episode takes 0.2 s in low, as measured on this server. An episode takes 1.0 s in dense, from other runs of this server. " +
        "An episode takes 0.09 s in mixed, as on a processor of ours; nothing like it has run here yet.",
    );
  });
});
