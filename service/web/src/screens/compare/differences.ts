/** In what the specifications of campaigns differ. Pure. */

import { setting } from "../../ui/text";

export interface Difference {
  /** Where, `budget.episodes`. */
  field: string;
  /** What each has there, in words. */
  values: string[];
}

const OWN = ["label"]; // of each campaign its own, and shown anyway

export function differences(specs: object[]): Difference[] {
  const flat = specs.map((spec) => new Map(leaves(spec)));
  const fields = [...new Set(flat.flatMap((each) => [...each.keys()]))].filter((field) => !OWN.includes(field));
  return fields
    .map((field) => ({ field, values: flat.map((each) => each.get(field) ?? "–") }))
    .filter(({ values }) => new Set(values).size > 1);
}

function leaves(value: unknown, path = ""): [string, string][] {
  if (value === null || typeof value !== "object") return [[path, value === null ? "–" : written(value)]];
  if (Array.isArray(value)) return [[path, value.map(written).join(", ") || "none"]];
  return Object.entries(value).flatMap(([name, part]) => leaves(part, path ? `${path}.${name}` : name));
}

function written(value: unknown): string {
  if (typeof value === "number") return setting(value);
  return value !== null && typeof value === "object" ? JSON.stringify(value) : String(value);
}
