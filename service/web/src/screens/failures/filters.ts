/** What is shown of the failures, as the address's query says it. */

import { parsed, written, type Brushes } from "./brushes";
import { SORTS, type Sort } from "./sorting";
import type { FailureTable } from "./wire";

/** Filters that want one value; the empty text wants any. */
export const FACETS = ["requirement", "family", "method", "run", "grade", "plausibility", "severity", "fault", "driven_by", "prevented_by", "kind", "striker", "triage", "broke", "ego_broke", "rule"] as const;
export type Facet = (typeof FACETS)[number];
export const BY = ["kind", "variant", "episode"] as const;
export type By = (typeof BY)[number];

export interface Filters extends Record<Facet, string> {
  /** Failures, or the episodes whose violations a rule refused. */
  tab: "failures" | "refused";
  /** What a card stands for. */
  by: By;
  q: string;
  sort: Sort;
  x: string;
  y: string;
  brushes: Brushes;
}

export function read(query: URLSearchParams): Filters {
  const text = (name: string) => query.get(name) ?? "";
  const facets = Object.fromEntries(FACETS.map((facet) => [facet, text(facet)])) as Record<Facet, string>;
  const sort = text("sort");
  return {
    ...facets,
    tab: text("tab") === "refused" ? "refused" : "failures",
    by: BY.find((by) => by === text("by")) ?? "kind",
    q: text("q"),
    sort: Object.hasOwn(SORTS, sort) ? (sort as Sort) : "severity",
    x: text("x") || "reaction",
    y: text("y") || "closing",
    brushes: parsed(text("brush")),
  };
}

/** What `router.address` writes; what is as usual is left out. */
export function queryOf(filters: Filters): Record<string, string> {
  const { tab, by, q, sort, x, y, brushes } = filters;
  return {
    tab: tab === "failures" ? "" : tab,
    by: by === "kind" ? "" : by,
    ...Object.fromEntries(FACETS.map((facet) => [facet, filters[facet]])),
    q,
    sort: sort === "severity" ? "" : sort,
    x: x === "reaction" ? "" : x,
    y: y === "closing" ? "" : y,
    brush: written(brushes),
  };
}

/** Takes back everything that hides failures; tab, order and axes stay. */
export function reset(filters: Filters): Filters {
  const { tab, by, sort, x, y } = filters;
  return { ...read(new URLSearchParams()), tab, by, sort, x, y };
}

export function isNarrowed(filters: Filters): boolean {
  return FACETS.some((facet) => filters[facet]) || !!filters.q.trim() || filters.brushes.size > 0;
}

/** The values that a failure has of a facet. */
export function valuesOf(table: FailureTable, facet: Facet, i: number): readonly string[] {
  switch (facet) {
    case "requirement":
      return table.valid[i] ? table.failed[i]! : [table.requirement[i]!];
    case "family":
      return [table.families[i]!];
    case "method":
      return [table.methods[i]!];
    case "run":
      return [table.run_ids[i]!];
    case "grade":
      return [table.grade[i] ?? "none"];
    case "plausibility":
      return [table.plausibility[i] ?? "none"];
    case "severity":
      return [table.severity[i] ?? "none"];
    case "fault":
      return [table.fault[i] ?? "none"];
    case "driven_by":
      return [table.driven_by[i] ?? "unknown"];
    case "prevented_by":
      return table.prevented_by[i]!.length ? table.prevented_by[i]! : ["nothing"];
    case "kind":
      return [table.kinds[table.kind[i]!]!.name];
    case "striker":
      return [table.striker[i] ?? "none"];
    case "triage":
      return [table.triage[i]!];
    case "broke":
      return table.broke[i]!.length ? table.broke[i]! : ["nothing"];
    case "ego_broke":
      return table.ego_broke[i]!.length ? table.ego_broke[i]! : ["nothing"];
    case "rule":
      return table.refused_by[i]!;
  }
}

/** The episodes of the tab, before any filter. */
export function inTab(table: FailureTable, { tab }: Pick<Filters, "tab">): number[] {
  const found: number[] = [];
  for (let i = 0; i < table.ids.length; i++) if (table.valid[i] === (tab === "failures")) found.push(i);
  return found;
}

/** The failures that pass every filter; brushes come later, see `within`. */
export function passing(table: FailureTable, failures: readonly number[], filters: Filters): readonly number[] {
  const wanted = FACETS.filter((facet) => filters[facet]);
  const terms = filters.q.toLowerCase().split(/\s+/).filter(Boolean);
  if (!wanted.length && !terms.length) return failures;
  return failures.filter(
    (i) =>
      wanted.every((facet) => valuesOf(table, facet, i).includes(filters[facet])) &&
      (!terms.length || said(table, i, terms)),
  );
}

/** The variant of a failure in words; empty where it is not valid. */
export function variantOf(table: FailureTable, i: number): string {
  return table.variants[table.variant[i] ?? -1] ?? "";
}

function said(table: FailureTable, i: number, terms: string[]): boolean {
  const lists = [table.failed, table.broke, table.ego_broke, table.refused_by].flatMap((column) => column[i]!);
  const text = [table.ids[i], table.requirement[i], table.kinds[table.kind[i]!]!.name, variantOf(table, i), table.striker[i] ?? "", ...lists];
  const all = text.join(" ").toLowerCase();
  return terms.every((term) => all.includes(term));
}

/** The column that numbers what a card stands for; null where that is an episode. */
export function groupsOf(table: FailureTable, by: By): readonly (number | null)[] | null {
  return by === "kind" ? table.kind : by === "variant" ? table.variant : null;
}

/** Each value of a facet and how many kinds, variants or episodes have it; the most frequent first. */
export function tally(table: FailureTable, failures: readonly number[], facet: Facet, by: By = "episode"): [string, number][] {
  const groups = groupsOf(table, by);
  const found = new Map<string, Set<number>>();
  for (const i of failures) {
    for (const value of valuesOf(table, facet, i)) {
      const those = found.get(value) ?? new Set();
      found.set(value, those.add(groups ? groups[i]! : i));
    }
  }
  const counts = [...found].map(([value, those]): [string, number] => [value, those.size]);
  return counts.sort((a, b) => b[1] - a[1] || a[0].localeCompare(b[0]));
}
