/** Whether a campaign has come to its end: nothing of it changes any more, but for what people note. */

import type { Body } from "./types";

const FINAL: readonly Body<"State">[] = ["succeeded", "failed", "cancelled"];

export function ended({ state }: { state: Body<"State"> }): boolean {
  return FINAL.includes(state);
}
