/** What is posted for a form's values. */

import type { Shape, Values } from "./schema";
import { sparse } from "./values";

/** What an ego has no use for, so that the service refuses it: of SUMO's drivers, or of a `perfect` one. */
export function unused(ego: Values): readonly string[] {
  if (ego.driver !== null && ego.driver !== undefined) return ["profile", "car_following", "reaction_time_s"];
  return ego.profile === "perfect" ? ["reaction_time_s", "sensor"] : [];
}

export function bodyOf(shape: Shape, spec: Values): Values {
  const body = sparse(shape, spec) as Values;
  if (body.ego === undefined) return body;
  const without = unused(spec.ego as Values);
  const { ego, ...rest } = body;
  const kept = Object.entries(ego as Values).filter(([name]) => !without.includes(name));
  return kept.length > 0 ? { ...body, ego: Object.fromEntries(kept) } : rest;
}

/** As it is sent and shown, letter by letter. */
export function textOf(body: Values): string {
  return JSON.stringify(body, null, 2);
}
