/** What the screens of maps make of the API's answers. */

import type { Body } from "../../api/types";
import { address } from "../../router";

export type Places = Body<"Places">;
export type Spot = Places["items"][number] | Places["elsewhere"][number];
export type Pattern = Spot["pattern"];

/** When to ask for them again, ms: as long as they are searched for. */
export function again(found: Places): number | null {
  return found.progress < 1 ? 2000 : null;
}

/** The patterns in the order of the API's description, with what happens in each. */
export const PATTERNS: readonly { name: Pattern; title: string; about: string }[] = [
  { name: "car_following", title: "Car following", about: "vehicles ahead and beside brake, adapt their speed and cut in" },
  { name: "crossing", title: "Hidden pedestrian", about: "a pedestrian steps out from behind a vehicle at a crossing" },
  { name: "junction", title: "Junction", about: "vehicles cross or turn, and a pedestrian walks" },
];

export const MOST_PLACES = 100; // of one campaign

/** How an upload is packed, told by its first bytes: its type has to say so. */
export function packagingOf(start: Uint8Array): string {
  if (start[0] === 0x1f && start[1] === 0x8b) return "application/gzip";
  return start[0] === 0x50 && start[1] === 0x4b ? "application/zip" : "application/xml";
}

/** Those of a pattern, or of all, whose name or description has the text. */
export function matching<Each extends Spot>(spots: readonly Each[], pattern: Pattern | "", text: string): Each[] {
  const wanted = text.trim().toLowerCase();
  return spots.filter((spot) => {
    const said = "summary" in spot ? spot.summary : spot.why;
    return (pattern === "" || spot.pattern === pattern) && `${spot.place} ${said}`.toLowerCase().includes(wanted);
  });
}

/** Where a campaign is begun at a place, or at all of a pattern. */
export function begin(network: string, pattern: Pattern, place: string | null): string {
  return address(["new"], { network, pattern, ...(place === null ? { places: "all" } : { place }) });
}
