/** Orders of failures, and the episode that stands for a kind or a variant. */

import { reactionOf } from "./features";
import type { FailureTable } from "./wire";

export type Sort = keyof typeof SORTS;

/** What people choose from; the first is meant where none is chosen. */
export const SORTS = {
  severity: "severity × plausibility",
  grade: "preventable first",
  closing: "fastest closing",
  reaction: "least time to contact",
  newest: "newest",
  often: "most frequent",
  rare: "rarest",
} as const;

/** Refused contacts have no grade, and are of no kind that counts. */
export const SORTS_OF: Record<"failures" | "refused", readonly Sort[]> = {
  failures: ["severity", "grade", "closing", "reaction", "newest", "often", "rare"],
  refused: ["closing", "reaction", "newest"],
};

const GRADES: readonly (string | null)[] = ["preventable", "full_braking", "unavoidable", null];
/** What has no severity touched nothing, and is no less than moderate. */
const SEVERITIES: readonly (string | null)[] = ["severe", "moderate", null, "minor"];
const FAULTS: readonly (string | null)[] = ["ego", "shared", "other", null];

/** The failures in that order: a new list; those without a value come last, the earlier one first among equals. */
export function sorted(table: FailureTable, failures: readonly number[], sort: Sort, often: ArrayLike<number>): number[] {
  const closing = (i: number) => -(table.relative_speed_mps[i] ?? -Infinity);
  const worst = (...first: ((i: number) => number)[]) => by(table, failures, ...first, closing);
  const grade = (i: number) => GRADES.indexOf(table.grade[i]!);
  const severity = (i: number) => SEVERITIES.indexOf(table.severity[i]!);
  const implausible = (i: number) => Number(table.plausibility[i] === "implausible");
  const weight = (i: number) => -table.weight[i]!;
  const fault = (i: number) => FAULTS.indexOf(table.fault[i]!);
  switch (sort) {
    case "severity":
      return worst(implausible, weight, severity, fault, grade);
    case "grade":
      return worst(grade, implausible, severity, fault);
    case "closing":
      return worst(closing);
    case "reaction":
      return worst((i) => reactionOf(table, i) ?? Infinity);
    case "newest":
      return [...failures].sort((a, b) => b - a);
    case "often":
      return worst((i) => -often[i]!);
    case "rare":
      return worst((i) => often[i]!);
  }
}

/** One episode for each group, a kind or a variant: that of the headline, else the worst. */
export function oneEach(table: FailureTable, failures: readonly number[], often: ArrayLike<number>, groups: readonly (number | null)[]): number[] {
  const found = new Map<number, number>();
  for (const i of sorted(table, failures, "severity", often)) {
    const group = groups[i]!;
    const before = found.get(group);
    if (before === undefined || (table.headline[i] && !table.headline[before])) found.set(group, i);
  }
  return [...found.values()];
}

/** The same failures with those of one kind together; kinds in the order of their first failure. */
export function underKinds(table: FailureTable, failures: readonly number[]): number[] {
  const first = new Map<number, number>();
  failures.forEach((i, place) => first.has(table.kind[i]!) || first.set(table.kind[i]!, place));
  return [...failures].sort((a, b) => first.get(table.kind[a]!)! - first.get(table.kind[b]!)!);
}

function by(table: FailureTable, failures: readonly number[], ...keys: ((i: number) => number)[]): number[] {
  const columns = keys.map(() => new Float64Array(table.ids.length));
  keys.forEach((key, k) => failures.forEach((i) => (columns[k]![i] = key(i))));
  return [...failures].sort((a, b) => {
    for (const column of columns) {
      const [first, second] = [column[a]!, column[b]!];
      if (first !== second) return first < second ? -1 : 1;
    }
    return a - b;
  });
}
