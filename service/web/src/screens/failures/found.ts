/** How often each kind or variant was found, by which methods, and what drove the adversaries. */

import { groupsOf, type By } from "./filters";
import type { FailureTable } from "./wire";

export interface Found {
  episodes: number;
  variants: number;
  runs: number;
  /** The most frequent first. */
  methods: string[];
  drivers: string[];
}

/** By failure; those of one kind, or of one variant where cards do not stand for kinds, share theirs. */
export function foundOf(table: FailureTable, by: By): Found[] {
  const groups = groupsOf(table, by === "kind" ? "kind" : "variant")!;
  const members = new Map<number, number[]>();
  groups.forEach((group, i) => {
    if (group === null || !table.valid[i]) return;
    const those = members.get(group);
    if (those) those.push(i);
    else members.set(group, [i]);
  });
  const shared = new Map([...members].map(([group, those]) => [group, foundIn(table, those)]));
  return groups.map((group, i) => (group === null || !table.valid[i] ? foundIn(table, [i]) : shared.get(group)!));
}

function foundIn(table: FailureTable, those: readonly number[]): Found {
  return {
    episodes: those.length,
    variants: new Set(those.map((i) => table.variant[i])).size,
    runs: new Set(those.map((i) => table.run_ids[i])).size,
    methods: byFrequency(those.map((i) => table.methods[i]!)),
    drivers: byFrequency(those.flatMap((i) => table.driven_by[i] ?? [])),
  };
}

function byFrequency(names: readonly string[]): string[] {
  const counts = new Map<string, number>();
  for (const name of names) counts.set(name, (counts.get(name) ?? 0) + 1);
  return [...counts].sort((a, b) => b[1] - a[1]).map(([name]) => name);
}
