/** Values of a form: read and changed by their path, filled with defaults, and cut down to what differs from them. */

import type { Json, Shape, Values } from "./schema";

export type Path = readonly (string | number)[];

/** As the API names a field: `requirements[0].formula`. */
export function pathText(path: Path): string {
  return path.map((part, i) => (typeof part === "number" ? `[${part}]` : i ? `.${part}` : part)).join("");
}

export function at(value: Json | undefined, path: Path): Json | undefined {
  return path.reduce<Json | undefined>((inner, part) => (inner as Values | undefined | null)?.[part], value);
}

/** The same value with another one at a path; what lies beside the path is shared. */
export function put(value: Json | undefined, path: Path, next: Json): Json {
  const [part, ...rest] = path;
  if (part === undefined) return next;
  if (typeof part === "number") {
    const list = [...((value ?? []) as Json[])];
    list[part] = put(list[part], rest, next);
    return list;
  }
  const before = (value ?? {}) as Values;
  return { ...before, [part]: put(before[part], rest, next) };
}

/** What a field is before anybody wrote into it, where the schema does not say. */
export function blank(shape: Shape): Json {
  if (shape.kind === "object") return filled(shape, {});
  if (shape.kind === "list") return [];
  if (shape.kind === "number") return Math.max(shape.low, Math.min(1, shape.high));
  if (shape.kind === "choice") return shape.options[0]!;
  return shape.kind === "switch" ? false : "";
}

/** A value with all that it leaves out. */
export function filled(shape: Shape, given: Json | undefined): Json {
  if (given === null) return null;
  if (shape.kind === "list" && Array.isArray(given)) return given.map((item) => filled(shape.item, item));
  if (shape.kind !== "object") return given ?? blank(shape);
  const values = (given ?? {}) as Values;
  return Object.fromEntries(
    shape.fields.map(({ name, shape: inner, preset }) => {
      const value = values[name] === undefined ? preset : values[name];
      return [name, value === undefined ? blank(inner) : filled(inner, value)];
    }),
  );
}

/**
 * What of a value differs from the defaults: the least that has to be sent.
 *
 * A field of an object that is sent in part has the default of the object's own schema, which is why each object is held
 * against that, and never against the default of what it lies in.
 */
export function sparse(shape: Shape, value: Json): Json {
  if (value === null) return null;
  if (shape.kind === "list") return (value as Json[]).map((item) => sparse(shape.item, item));
  if (shape.kind !== "object") return value;
  const kept: Values = {};
  for (const { name, shape: inner, preset } of shape.fields) {
    const field = (value as Values)[name];
    if (field === undefined) continue;
    if (preset !== undefined && equal(field, filled(inner, preset))) continue;
    kept[name] = sparse(inner, field);
  }
  return kept;
}

export function equal(one: Json | undefined, other: Json | undefined): boolean {
  if (Object.is(one, other)) return true;
  if (typeof one !== "object" || typeof other !== "object" || !one || !other) return false;
  if (Array.isArray(one) !== Array.isArray(other)) return false;
  const names = Object.keys(one);
  if (names.length !== Object.keys(other).length) return false;
  return names.every((name) => equal((one as Values)[name], (other as Values)[name]));
}

/** How many values a part of a spec has: a list is one, and so is null. */
export function leaves(value: Json | undefined): number {
  if (value === undefined) return 0;
  if (value === null || typeof value !== "object" || Array.isArray(value)) return 1;
  return Object.values(value).reduce<number>((sum, each) => sum + leaves(each), 0);
}
