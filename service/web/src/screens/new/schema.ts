/** What a form needs to know of a JSON schema: for each field its kind, bounds, default and meaning. */

import { words } from "../../ui/text";

export type Json = null | boolean | number | string | Json[] | { [name: string]: Json };
export type Values = { [name: string]: Json };

/** The part of JSON Schema that the API's description uses. */
export interface Schema {
  $ref?: string;
  type?: string | string[];
  enum?: string[];
  anyOf?: Schema[];
  properties?: Record<string, Schema>;
  required?: string[];
  items?: Schema;
  default?: Json;
  description?: string;
  minimum?: number;
  maximum?: number;
  minItems?: number;
  maxItems?: number;
  maxLength?: number;
  pattern?: string;
}

interface RequestBody {
  $ref?: string;
  content?: Record<string, { schema: Schema }>;
}

export interface Description {
  paths: Record<string, Record<string, { requestBody?: RequestBody }>>;
  components: { schemas: Record<string, Schema>; requestBodies?: Record<string, RequestBody> };
}

export type Shape =
  | { kind: "object"; about: string; fields: Field[] }
  | { kind: "list"; item: Shape; least: number; most: number }
  | { kind: "number"; integer: boolean; low: number; high: number }
  | { kind: "text"; most: number; pattern: string }
  | { kind: "choice"; options: string[] }
  | { kind: "switch" };

export interface Field {
  name: string;
  title: string;
  unit: string;
  about: string;
  shape: Shape;
  /** Whether it may be null. */
  optional: boolean;
  /** What it is where it is left out; undefined where it must not be. */
  preset: Json | undefined;
}

/** The shape of what is posted to a path. */
export function posted(description: Description, path: string): Shape {
  const body = description.paths[path]?.post?.requestBody;
  const shared = description.components.requestBodies?.[body?.$ref?.split("/").at(-1) ?? ""];
  const schema = (shared ?? body)?.content?.["application/json"]?.schema;
  if (!schema) throw new Error(`the service's description tells of no POST ${path}`);
  return shapeOf(schema, description.components.schemas);
}

export function shapeOf(schema: Schema, schemas: Record<string, Schema>): Shape {
  const known = resolved(schema, schemas);
  if (known.properties) {
    const fields = Object.entries(known.properties).map(([name, each]) => fieldOf(name, each, schemas));
    return { kind: "object", about: oneLine(known.description), fields };
  }
  if (known.anyOf?.[0]) return shapeOf(known.anyOf[0], schemas); // the others are what a form does not offer
  if (known.enum) return { kind: "choice", options: known.enum };
  const type = Array.isArray(known.type) ? known.type[0] : known.type; // the other is null
  if (type === "array") {
    const { items = {}, minItems = 0, maxItems = Infinity } = known;
    return { kind: "list", item: shapeOf(items, schemas), least: minItems, most: maxItems };
  }
  if (type === "boolean") return { kind: "switch" };
  if (type === "number" || type === "integer") {
    const { minimum = -Infinity, maximum = Infinity } = known;
    return { kind: "number", integer: type === "integer", low: minimum, high: maximum };
  }
  return { kind: "text", most: known.maxLength ?? Infinity, pattern: known.pattern ?? "" };
}

function fieldOf(name: string, schema: Schema, schemas: Record<string, Schema>): Field {
  const named = resolved(schema, schemas);
  const some = named.anyOf?.filter((each) => each.type !== "null") ?? [];
  const optional = named.anyOf ? some.length < named.anyOf.length : (named.type?.includes("null") ?? false);
  const [title, unit] = titleOf(name);
  return {
    name,
    title,
    unit,
    about: oneLine(schema.description),
    shape: shapeOf(some[0] ?? named, schemas),
    optional,
    preset: schema.default,
  };
}

function resolved(schema: Schema, schemas: Record<string, Schema>): Schema {
  if (schema.$ref === undefined) return schema;
  const name = schema.$ref.split("/").at(-1)!;
  const found = schemas[name];
  if (!found) throw new Error(`the service's description has no ${name}`);
  return resolved(found, schemas);
}

const UNITS: Record<string, string> = { mps: "m/s", mps2: "m/s²", mps3: "m/s³", radps: "rad/s", m: "m", s: "s", rad: "rad" };
const LONG: Record<string, string> = { accel: "acceleration", cpu: "CPU time", odd: "ODD", ttc: "TTC", rss: "RSS", td: "TD", sac: "SAC", ddpg: "DDPG" };

/** `reaction_time_s` -> "Reaction time" and "s"; `ttc_scale_s` -> "TTC scale" and "s". */
export function titleOf(name: string): [title: string, unit: string] {
  const cut = name.lastIndexOf("_");
  const unit = cut > 0 ? UNITS[name.slice(cut + 1)] : undefined;
  const said = words(unit === undefined ? name : name.slice(0, cut)).replaceAll(/[a-z]+/g, (word) => LONG[word] ?? word);
  return [said.charAt(0).toUpperCase() + said.slice(1), unit ?? ""];
}

function oneLine(text = ""): string {
  return text.replaceAll(/\s*\n\s*/g, " ");
}
