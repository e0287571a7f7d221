/** Orders of failures. */

import { reactionOf } from "./features";
import type { FailureTable } from "./wire";

export type Sort = keyof typeof SORTS;

/** What people choose from; the first is meant where none is chosen. */
export const SORTS = {
  grade: "preventable first",
  closing: "fastest closing",
  reaction: "least time to contact",
  newest: "newest",
  often: "most frequent",
  rare: "rarest",
} as const;

/** Refused contacts have no grade, and are of no kind that counts. */
export const SORTS_OF: Record<"failures" | "refused", readonly Sort[]> = {
  failures: ["grade", "closing", "reaction", "newest", "often", "rare"],
  refused: ["closing", "reaction", "newest"],
};

const RANKS: Record<string, number> = { preventable: 0, full_braking: 1, unavoidable: 2 };
const UNGRADED = 3;

/** The failures in that order: a new list; who has no value comes last, the earlier one first among equals. */
export function sorted(table: FailureTable, failures: readonly number[], sort: Sort, often: ArrayLike<number>): number[] {
  const closing = (i: number) => -(table.relative_speed_mps[i] ?? -Infinity);
  const worst = (first: (i: number) => number) => by(table, failures, first, closing);
  switch (sort) {
    case "grade":
      return worst((i) => RANKS[table.grade[i] ?? ""] ?? UNGRADED);
    case "closing":
      return worst(closing);
    case "reaction":
      return worst((i) => reactionOf(table, i) ?? Infinity);
    case "newest":
      return [...failures].reverse();
    case "often":
      return worst((i) => -often[i]!);
    case "rare":
      return worst((i) => often[i]!);
  }
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
