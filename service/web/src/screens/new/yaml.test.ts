import { describe, expect, it } from "vitest";
import type { Json } from "./schema";
import { yaml } from "./yaml";

describe("YAML", () => {
  it("nests objects, and keeps lists of plain values on one line", () => {
    const spec: Json = { families: ["low", "mixed"], seeds: [0, 1], budget: { episodes: 60 }, requirements: [{ name: "a", scale: 0.5 }, { name: "b" }] };
    expect(yaml(spec)).toBe(
      [
        "families: [low, mixed]",
        "seeds: [0, 1]",
        "budget:",
        "  episodes: 60",
        "requirements:",
        "  - name: a",
        "    scale: 0.5",
        "  - name: b",
        "",
      ].join("\n"),
    );
  });

  it.each<[Json, string]>([
    ["plain words-and_more 1", "plain words-and_more 1"],
    ["", '""'],
    ["yes", '"yes"'],
    ["Off", '"Off"'],
    ["n", '"n"'],
    ["null", '"null"'],
    ["~", '"~"'],
    ["12", '"12"'],
    ["1e3", '"1e3"'],
    ["2026-11-22", '"2026-11-22"'],
    ["a: b", '"a: b"'],
    ["a #b", '"a #b"'],
    [" a", '" a"'],
    ["a ", '"a "'],
    ["- a", '"- a"'],
    ["{a}", '"{a}"'],
    ["it's", '"it\'s"'],
    ['say "no"', '"say \\"no\\""'],
    ["a\nb\\", '"a\\nb\\\\"'],
    ["\u0085\u2028\ufeff\u007f", '"\\u0085\\u2028\\ufeff\\u007f"'],
    ["größer 🚗", '"größer 🚗"'],
    [null, "null"],
    [true, "true"],
    [[], "[]"],
    [{}, "{}"],
    [1e-7, "1.0e-7"],
    [2.5e21, "2.5e+21"],
    [-0.1, "-0.1"],
  ])("writes %j", (value, wanted) => expect(yaml(value)).toBe(`${wanted}\n`));

  it("writes what is empty, and lists of lists", () => {
    expect(yaml({ odd: {}, requirements: [], deep: [[1], []] })).toBe("odd: {}\nrequirements: []\ndeep:\n  - - 1\n  - []\n");
  });
});
