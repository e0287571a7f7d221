/** Scenarios in a list: their titles, and those that match a text. */

import { queue } from "../../api/turn";
import type { Body } from "../../api/types";
import { words } from "../../ui/text";

export type Summary = Body<"ScenarioSummary">;

/** For checks, of which the service makes two at once. */
export const checking = queue();

/** A name in words, without the digest that the service adds: `ramp_merge_0123456789ab` -> "Ramp merge". */
export function titleOf(name: string): string {
  const said = words(name.replace(/_[0-9a-f]{12}$/, ""));
  return said.charAt(0).toUpperCase() + said.slice(1);
}

/** Those that have every word of a text in name, summary, tags or actors. */
export function matching<Each extends Pick<Summary, "name" | "summary" | "tags" | "actors">>(items: readonly Each[], text: string): Each[] {
  const wanted = text.toLowerCase().split(/\s+/).filter(Boolean);
  return items.filter(({ name, summary, tags, actors }) => {
    const said = [name, titleOf(name), summary, ...tags, ...actors].join(" ").toLowerCase();
    return wanted.every((word) => said.includes(word));
  });
}
