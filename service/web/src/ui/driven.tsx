/** What drove the adversaries of an episode, in words. */

import type { Body } from "../api/types";
import { count } from "./text";

export type DrivenBy = Body<"DrivenBy">;

/** The most learnt first. */
export const DRIVEN_BY: readonly DrivenBy[] = ["policy", "model", "script", "random"];
const WORDS: Record<DrivenBy, string> = { policy: "by the policy", model: "by the script model", script: "by a script", random: "at random" };

/** Says what drove an episode; nothing where that is not known. */
export function DrivenTag({ by }: { by: DrivenBy | null | undefined }) {
  return by ? <span class="tag">driven {drivenWords(by)}</span> : null;
}

/** `by the policy`; what another version knew stays as it is. */
export function drivenWords(by: string): string {
  return Object.hasOwn(WORDS, by) ? WORDS[by as DrivenBy] : by;
}

/** `41 episodes driven by the policy, 137 by a script`; empty where nothing is known. */
export function drivenSummary(counts: Record<string, number>): string {
  const told = DRIVEN_BY.filter((by) => counts[by]).map((by) => [count(counts[by]!), drivenWords(by)]);
  return told.map(([number, words], at) => (at ? `${number} ${words}` : `${number} episode${number === "1" ? "" : "s"} driven ${words}`)).join(", ");
}
