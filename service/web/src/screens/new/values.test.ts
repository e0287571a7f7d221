import { describe, expect, it } from "vitest";
import type { Field, Json, Shape } from "./schema";
import { at, filled, leaves, pathText, put, sparse } from "./values";

const number: Shape = { kind: "number", integer: false, low: 0, high: 100 };
const field = (name: string, shape: Shape, preset: Json | undefined, optional = false): Field => ({
  name,
  shape,
  preset,
  optional,
  title: name,
  unit: "",
  about: "",
});
const object = (...fields: Field[]): Shape => ({ kind: "object", about: "", fields });
const sensor = object(field("range_m", number, 80), field("memory_s", number, 3));
const interval = object(field("low", number, undefined), field("high", number, undefined));
const requirement = object(field("name", { kind: "text", most: 9, pattern: "" }, undefined), field("shapes", { kind: "switch" }, true));
const shape = object(
  field("families", { kind: "list", item: { kind: "choice", options: ["low", "dense"] }, least: 1, most: 2 }, undefined),
  field("ego", object(field("reaction_s", number, 0.5), field("sensor", sensor, { range_m: 80, memory_s: 3 }, true)), {}),
  field("odd", object(field("lanes", interval, null, true)), { lanes: null }),
  field("requirements", { kind: "list", item: requirement, least: 0, most: 9 }, []),
);
const defaults = {
  families: [],
  ego: { reaction_s: 0.5, sensor: { range_m: 80, memory_s: 3 } },
  odd: { lanes: null },
  requirements: [],
};

describe("what differs from the defaults", () => {
  it.each<[string, Json, Json]>([
    ["nothing but what has none", { ...defaults, families: ["low"] }, { families: ["low"] }],
    [
      "one value deep within",
      { ...defaults, ego: { reaction_s: 0.5, sensor: { range_m: 60, memory_s: 3 } } },
      { families: [], ego: { sensor: { range_m: 60 } } },
    ],
    ["null in the place of an object", { ...defaults, ego: { reaction_s: 0.5, sensor: null } }, { families: [], ego: { sensor: null } }],
    ["an object in the place of null", { ...defaults, odd: { lanes: { low: 1, high: 2 } } }, { families: [], odd: { lanes: { low: 1, high: 2 } } }],
    [
      "items of a list, each cut down",
      { ...defaults, requirements: [{ name: "a", shapes: true }, { name: "b", shapes: false }] },
      { families: [], requirements: [{ name: "a" }, { name: "b", shapes: false }] },
    ],
  ])("is %s", (_, value, wanted) => {
    expect(sparse(shape, value)).toEqual(wanted);
    expect(filled(shape, wanted)).toEqual(value); // and the service, which fills in its defaults, reads the same
  });

  it("is held against an object's own defaults, and not against those of what it lies in", () => {
    const odd = object(field("sensor", sensor, { range_m: 20, memory_s: 3 }));
    expect(sparse(odd, { sensor: { range_m: 20, memory_s: 3 } })).toEqual({});
    expect(sparse(odd, { sensor: { range_m: 20, memory_s: 1 } })).toEqual({ sensor: { range_m: 20, memory_s: 1 } });
    expect(sparse(odd, { sensor: { range_m: 80, memory_s: 3 } })).toEqual({ sensor: {} });
  });
});

describe("a path", () => {
  it("is written as the service writes it", () => {
    expect(pathText(["requirements", 0, "formula"])).toBe("requirements[0].formula");
  });

  it("leads to a value, or to nothing where a part is missing", () => {
    expect(at(defaults, ["ego", "sensor", "range_m"])).toBe(80);
    expect(at(defaults, ["odd", "lanes", "low"])).toBeUndefined();
  });

  it("changes a copy, and shares what lies beside it", () => {
    const next = put(defaults, ["requirements", 0, "name"], "a") as typeof defaults;
    expect(next.requirements).toEqual([{ name: "a" }]);
    expect(defaults.requirements).toEqual([]);
    expect(next.ego).toBe(defaults.ego);
    expect(put(defaults, ["odd", "lanes", "low"], 1)).toMatchObject({ odd: { lanes: { low: 1 } } });
  });
});

it("a list and null are one value each", () => {
  expect(leaves({ a: 1, b: { c: [1, 2], d: null }, e: {} })).toBe(3);
  expect(leaves(undefined)).toBe(0);
});
