/** How runs are told apart: colour and dash are the method's, as in the report's figures; a family shifts the dash. */

import type { Body } from "../../api/types";
import { METHODS, type MethodColour } from "../../ui/palette";

type Spec = Body<"CampaignSpec">;
export type Mark = { colour: Colour; dash: number[] };

/** Of what is no method, such as campaigns beside each other. */
export const COLOURS = ["--series-1", "--series-2", "--series-3", "--series-4", "--series-5", "--series-6"] as const;
export type Colour = (typeof COLOURS)[number] | MethodColour;
const DASHES: Record<string, number[]> = { "-": [], "--": [8, 4], "-.": [10, 3, 2, 3], ":": [2, 3] };
const IN_ORDER = Object.values(DASHES);

interface Which {
  family: string;
  method: string;
  seed: number;
}

export function markOf(spec: Pick<Spec, "families">, { family, method }: Pick<Which, "family" | "method">): Mark {
  const look = METHODS[method];
  const own = Math.max(0, IN_ORDER.indexOf(DASHES[look?.dashes ?? "-"]!));
  const place = Math.max(0, (spec.families as string[]).indexOf(family));
  return { colour: look?.colour ?? "--series-1", dash: IN_ORDER[(own + place) % IN_ORDER.length]! };
}

/** What runs of a style have in common, in as few words as the campaign needs. */
export function groupName(spec: Pick<Spec, "families">, { family, method }: Pick<Which, "family" | "method">): string {
  return spec.families.length > 1 ? `${method}, ${family}` : method;
}

export function runName(spec: Pick<Spec, "families" | "seeds">, run: Which): string {
  return groupName(spec, run) + (spec.seeds.length > 1 ? `, seed ${run.seed}` : "");
}
