/** How soon to ask again: a service that takes its time is left alone for as long as twenty such answers. */

const SHARE = 20;
const LONGEST_MS = 30_000;

export function paced(waitMs: number, tookMs: number): number {
  return Math.max(waitMs, Math.min(SHARE * tookMs, LONGEST_MS));
}
