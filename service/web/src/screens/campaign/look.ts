/** How runs are told apart: the colour is the method's; the dash goes by family too, so that none goes by colour alone. */

import type { Body } from "../../api/types";

type Spec = Body<"CampaignSpec">;
export type Mark = { colour: Colour; dash: number[] };

export const COLOURS = ["--series-1", "--series-2", "--series-3", "--series-4", "--series-5", "--series-6"] as const;
export type Colour = (typeof COLOURS)[number];
const DASHES = [[], [8, 4], [2, 3], [10, 3, 2, 3], [14, 4]];

interface Which {
  family: string;
  method: string;
  seed: number;
}

export function markOf(spec: Pick<Spec, "families" | "methods">, { family, method }: Pick<Which, "family" | "method">): Mark {
  const colour = Math.max(0, (spec.methods as string[]).indexOf(method));
  const dash = colour + Math.max(0, (spec.families as string[]).indexOf(family));
  return { colour: COLOURS[colour % COLOURS.length]!, dash: DASHES[dash % DASHES.length]! };
}

/** What runs of a style have in common, in as few words as the campaign needs. */
export function groupName(spec: Pick<Spec, "families">, { family, method }: Pick<Which, "family" | "method">): string {
  return spec.families.length > 1 ? `${method}, ${family}` : method;
}

export function runName(spec: Pick<Spec, "families" | "seeds">, run: Which): string {
  return groupName(spec, run) + (spec.seeds.length > 1 ? `, seed ${run.seed}` : "");
}
