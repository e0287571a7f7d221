import { describe, expect, it } from "vitest";
import { posted, shapeOf, titleOf, type Description, type Schema } from "./schema";

const SCHEMAS: Record<string, Schema> = {
  Budget: {
    type: "object",
    description: "What each run\nmay spend.",
    properties: {
      episodes: { type: "integer", minimum: 1, maximum: 100, default: 30, description: "Search episodes." },
      cpu_s: { type: ["number", "null"], minimum: 0.1, default: null },
    },
  },
  Spec: {
    type: "object",
    required: ["families"],
    properties: {
      families: { type: "array", items: { type: "string", enum: ["low", "dense"] }, minItems: 1, maxItems: 2 },
      budget: { $ref: "#/components/schemas/Budget", default: { episodes: 30, cpu_s: null } },
      sensor: { anyOf: [{ $ref: "#/components/schemas/Budget" }, { type: "null" }], default: null },
      label: { type: "string", maxLength: 9, default: "" },
      shapes: { type: "boolean", default: true },
    },
  },
};

describe("a shape", () => {
  const shape = shapeOf({ $ref: "#/components/schemas/Spec" }, SCHEMAS);
  const field = (name: string) => (shape.kind === "object" ? shape.fields.find((each) => each.name === name)! : undefined)!;

  it("follows references, and keeps the default that stands beside one", () => {
    expect(field("budget").preset).toEqual({ episodes: 30, cpu_s: null });
    expect(field("budget").shape).toMatchObject({ kind: "object", about: "What each run may spend." });
  });

  it("tells numbers with their bounds", () => {
    const budget = field("budget").shape;
    const [episodes, cpu] = budget.kind === "object" ? budget.fields : [];
    expect(episodes!.shape).toEqual({ kind: "number", integer: true, low: 1, high: 100 });
    expect(cpu).toMatchObject({ optional: true, preset: null, title: "CPU time", unit: "s" });
    expect(cpu!.shape).toEqual({ kind: "number", integer: false, low: 0.1, high: Infinity });
  });

  it("knows what may be null from what may not, objects too", () => {
    expect(field("sensor")).toMatchObject({ optional: true, shape: { kind: "object" } });
    expect(field("budget").optional).toBe(false);
  });

  it("tells lists of names, and what has no default", () => {
    expect(field("families").preset).toBeUndefined();
    expect(field("families").shape).toEqual({ kind: "list", item: { kind: "choice", options: ["low", "dense"] }, least: 1, most: 2 });
    expect(field("label").shape).toEqual({ kind: "text", most: 9, pattern: "" });
    expect(field("shapes").shape).toEqual({ kind: "switch" });
  });

  it("is found by the path that takes it, or the path is named", () => {
    const content = { "application/json": { schema: { $ref: "#/components/schemas/Spec" } } };
    const description: Description = { paths: { "/v1/campaigns": { post: { requestBody: { content } } } }, components: { schemas: SCHEMAS } };
    expect(posted(description, "/v1/campaigns")).toEqual(shape);
    const requestBodies = { shared: { content } };
    const referring: Description = {
      paths: { "/v1/campaigns": { post: { requestBody: { $ref: "#/components/requestBodies/shared" } } } },
      components: { schemas: SCHEMAS, requestBodies },
    };
    expect(posted(referring, "/v1/campaigns")).toEqual(shape);
    expect(() => posted(description, "/v1/other")).toThrow("/v1/other");
  });
});

describe("a title", () => {
  it.each([
    ["reaction_time_s", "Reaction time", "s"],
    ["vehicle_accel_mps2", "Vehicle acceleration", "m/s²"],
    ["ttc_scale_s", "TTC scale", "s"],
    ["lanes", "Lanes", ""],
    ["m", "M", ""],
  ])("of %s", (name, title, unit) => expect(titleOf(name)).toEqual([title, unit]));
});
