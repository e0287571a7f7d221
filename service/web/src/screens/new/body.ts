/** What is posted for a form's values. */

import type { Shape, Values } from "./schema";
import { sparse } from "./values";

/** What a `perfect` ego has no use for: the service refuses its delay and its sensor. */
export const NOT_OF_PERFECT: readonly string[] = ["reaction_time_s", "sensor"];

export function isPerfect(spec: Values): boolean {
  return (spec.ego as Values | undefined)?.profile === "perfect";
}

export function bodyOf(shape: Shape, spec: Values): Values {
  const body = sparse(shape, spec) as Values;
  if (!isPerfect(spec)) return body;
  const ego = Object.entries(body.ego as Values).filter(([name]) => !NOT_OF_PERFECT.includes(name));
  return { ...body, ego: Object.fromEntries(ego) };
}

/** As it is sent and shown, letter by letter. */
export function textOf(body: Values): string {
  return JSON.stringify(body, null, 2);
}
