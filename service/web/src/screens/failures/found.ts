/** How often each distinct failure was found, by which methods, and what drove the adversaries. */

import type { FailureTable } from "./wire";

export interface Found {
  episodes: number;
  runs: number;
  /** The most frequent first. */
  methods: string[];
  drivers: string[];
}

/** By failure; those of one distinct failure share theirs. */
export function foundOf(table: FailureTable): Found[] {
  const members = new Map<number, number[]>();
  table.niche.forEach((niche, i) => {
    if (niche === null) return;
    const those = members.get(niche);
    if (those) those.push(i);
    else members.set(niche, [i]);
  });
  const shared = new Map([...members].map(([niche, those]) => [niche, foundIn(table, those)]));
  return table.niche.map((niche, i) => (niche === null ? foundIn(table, [i]) : shared.get(niche)!));
}

function foundIn(table: FailureTable, those: readonly number[]): Found {
  return {
    episodes: those.length,
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
