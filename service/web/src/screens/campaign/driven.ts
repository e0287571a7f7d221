/** How many episodes of a search each thing drove, at each point of its curve. Pure. */

import { DRIVEN_BY, type DrivenBy } from "../../ui/driven";

/** What drove -> episodes so far, an entry per point; without what never did. */
export type Driven = Record<string, number[]>;

interface Driving {
  episodes: number[];
  driven_by: Driven;
}

/** Adds the newest episode, as the point at this place. */
export function drive(driven: Driven, at: number, by: DrivenBy | null): void {
  if (by !== null) driven[by] ??= Array<number>(at).fill(0);
  for (const [name, counts] of Object.entries(driven)) counts[at] = (counts.at(-1) ?? 0) + (name === by ? 1 : 0);
}

/** The counts at some of the points. */
export function drivenAt(driven: Driven, places: number[]): Driven {
  return Object.fromEntries(Object.entries(driven).map(([by, counts]) => [by, places.map((at) => counts[at]!)]));
}

/** Counts at the newest point. */
export function drivenSoFar(driven: Driven): Record<string, number> {
  return Object.fromEntries(Object.entries(driven).map(([by, counts]) => [by, counts.at(-1) ?? 0]));
}

/** How many episodes came before the policy's first; 0 where it never drove. */
export function warmUp({ episodes, driven_by }: Driving): number {
  const counts = driven_by.policy ?? [];
  const first = counts.findIndex((drove) => drove > 0);
  return first < 0 ? 0 : episodes[first]! - counts[first]!;
}

/** Outlines in episodes and shares: from point to point the shares of what drove lie on each other. */
export function shares({ episodes, driven_by }: Driving): [DrivenBy, string][] {
  const paths = new Map<DrivenBy, string>();
  episodes.forEach((end, at) => {
    const begin = episodes[at - 1] ?? 0;
    let low = 0;
    for (const by of DRIVEN_BY) {
      const counts = driven_by[by];
      const high = counts ? low + (counts[at]! - (counts[at - 1] ?? 0)) / (end - begin) : low;
      if (high > low) paths.set(by, `${paths.get(by) ?? ""}M${begin} ${low}H${end}V${high}H${begin}Z`);
      low = high;
    }
  });
  return [...paths];
}
