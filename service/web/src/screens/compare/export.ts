/** The rows of several campaigns as files. Pure. */

import type { Row } from "./rows";

export interface Line {
  family: string;
  campaign: string;
  label: string;
  row: Row;
}

const COLUMNS: [string, (line: Line) => string | number | null][] = [
  ["family", (line) => line.family],
  ["campaign", (line) => line.campaign],
  ["label", (line) => line.label],
  ["method", (line) => line.row.key.split(" ").at(-1)!],
  ["runs", ({ row }) => row.runs],
  ["headline", ({ row }) => row.headline],
  ["headline_published", ({ row }) => row.headline_published],
  ["episodes", ({ row }) => row.episodes],
  ["contacts", ({ row }) => row.raw_collisions],
  ["failures", ({ row }) => row.failures],
  ["distinct", ({ row }) => row.distinct_failures],
  ["preventable", ({ row }) => row.distinct_preventable],
  ["published", ({ row }) => row.distinct_published],
  ["ecr", ({ row }) => row.ecr.mean],
  ["ecr_low", ({ row }) => row.ecr.low],
  ["ecr_high", ({ row }) => row.ecr.high],
  ["pcr", ({ row }) => row.pcr.mean],
  ["pcr_low", ({ row }) => row.pcr.low],
  ["pcr_high", ({ row }) => row.pcr.high],
];

export function csv(lines: Line[]): string {
  const table = [COLUMNS.map(([name]) => name), ...lines.map((line) => COLUMNS.map(([, value]) => value(line)))];
  return table.map((cells) => cells.map(quoted).join(",") + "\r\n").join("");
}

export function markdown(lines: Line[]): string {
  const row = (cells: (string | number | null)[]) => `| ${cells.map((cell) => String(cell ?? "–").replace(/[|\\\n]/g, " ")).join(" | ")} |\n`;
  return row(COLUMNS.map(([name]) => name)) + row(COLUMNS.map(() => "---")) + lines.map((line) => row(COLUMNS.map(([, value]) => value(line)))).join("");
}

export function json(lines: Line[]): string {
  return JSON.stringify(lines.map((line) => Object.fromEntries(COLUMNS.map(([name, value]) => [name, value(line)]))), null, 2);
}

/** As RFC 4180 has it; a label that a spreadsheet would take for a formula is kept from it. */
function quoted(value: string | number | null): string {
  if (typeof value !== "string") return value === null ? "" : String(value);
  const text = /^[=+\-@\t]/.test(value) ? `'${value}` : value;
  return /[",\r\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text;
}
