/** A spec as YAML that every YAML reader, of version 1.1 or 1.2, takes for the same as its JSON. */

import type { Json } from "./schema";

/** Words that YAML 1.1 takes for something else than text. */
const TAKEN = /^(y|n|yes|no|on|off|true|false|null|nan|inf|infinity)$/i;
const PLAIN = /^[A-Za-z][A-Za-z0-9_-]*( [A-Za-z0-9_-]+)*$/;
/** What a quoted text may hold in JSON but not in YAML: other controls, line ends and marks of byte order. */
const UNPRINTABLE = /[\u007f-\u009f\u2028\u2029\ufeff\ufffe\uffff]/g;

export function yaml(value: Json): string {
  return isBranch(value) ? `${lines(value, "").join("\n")}\n` : `${scalar(value)}\n`;
}

type Branch = Json[] | { [name: string]: Json };

function isBranch(value: Json): value is Branch {
  return typeof value === "object" && value !== null && Object.keys(value).length > 0;
}

function lines(value: Branch, indent: string): string[] {
  if (!Array.isArray(value)) return Object.entries(value).flatMap(([name, each]) => entry(name, each, indent));
  return value.flatMap((item) => {
    if (!isBranch(item)) return [`${indent}- ${scalar(item)}`];
    const [first, ...rest] = lines(item, `${indent}  `);
    return [`${indent}- ${first!.trimStart()}`, ...rest];
  });
}

function entry(name: string, value: Json, indent: string): string[] {
  const key = `${indent}${text(name)}:`;
  if (!isBranch(value)) return [`${key} ${scalar(value)}`];
  if (Array.isArray(value) && !value.some(isBranch)) return [`${key} [${value.map(scalar).join(", ")}]`];
  return [key, ...lines(value, `${indent}  `)];
}

function scalar(value: Json): string {
  if (Array.isArray(value)) return "[]";
  if (value === null) return "null";
  if (typeof value === "object") return "{}";
  if (typeof value === "string") return text(value);
  return typeof value === "number" ? numeral(value) : String(value);
}

function text(value: string): string {
  if (PLAIN.test(value) && !TAKEN.test(value)) return value;
  const escaped = (each: string) => `\\u${each.charCodeAt(0).toString(16).padStart(4, "0")}`;
  return JSON.stringify(value).replaceAll(UNPRINTABLE, escaped);
}

/** YAML 1.1 takes 1e-7 for text: it wants a point and the exponent's sign. */
function numeral(value: number): string {
  const [digits, exponent] = String(value).split("e");
  return exponent === undefined ? digits! : `${digits!.includes(".") ? digits : `${digits}.0`}e${exponent}`;
}
