/** What failures are measured by: how the violation came out, and the scene it began from. */

import type { FailureTable } from "./wire";
import { words } from "../../ui/text";

export interface Feature {
  /** Its name in the address; scene parameters begin with `scene.`, since both have an `ego_speed_mps`. */
  key: string;
  label: string;
  unit: string;
  /** One per failure; NaN where there is none. */
  values: Float64Array;
}

type Measured = (table: FailureTable, i: number) => number | null;
interface Outcome {
  label: string;
  unit: string;
  of: Measured;
}

const OUTCOMES: Record<string, Outcome> = {
  closing: { label: "closing speed", unit: "m/s", of: (t, i) => t.relative_speed_mps[i]! },
  reaction: { label: "conflict to contact", unit: "s", of: reactionOf },
  ego_speed: { label: "ego's speed then", unit: "m/s", of: (t, i) => t.ego_speed_mps[i]! },
  striker_speed: { label: "striker's speed then", unit: "m/s", of: (t, i) => t.other_speed_mps[i]! },
  seen: { label: "striker seen for", unit: "s", of: (t, i) => t.visible_for_s[i]! },
  braking: { label: "ego's peak braking", unit: "m/s²", of: (t, i) => t.ego_peak_braking_mps2[i]! },
  robustness: { label: "least robustness", unit: "", of: (t, i) => t.min_robustness[i]! },
  rss_margin: { label: "least RSS margin", unit: "m", of: (t, i) => t.min_rss_margin_m[i]! },
  ttc: { label: "least TTC", unit: "s", of: (t, i) => t.min_ttc_s[i]! },
  offset: { label: "lateral offset", unit: "m", of: (t, i) => t.lateral_offset_m[i]! },
  time: { label: "release to violation", unit: "s", of: (t, i) => t.time_s[i]! },
};

/** From when the conflict began to the contact, s: how long a driver had to act. */
export function reactionOf(table: FailureTable, i: number): number | null {
  const [began, ended] = [table.conflict_s[i], table.time_s[i]];
  return began == null || ended == null ? null : ended - began;
}

export function outcomeFeatures(table: FailureTable): Feature[] {
  return Object.entries(OUTCOMES).map(([key, { label, unit, of }]) => {
    const values = Float64Array.from(table.ids, (_, i) => of(table, i) ?? NaN);
    return { key, label, unit, values };
  });
}

/** The scene's parameters of one family; failures of other families have none. */
export function sceneFeatures(table: FailureTable, family: string): Feature[] {
  const scenes = Object.hasOwn(table.scenes, family) ? table.scenes[family]! : { names: [], rows: [], of: [] };
  return scenes.names.map((name, column) => {
    const values = new Float64Array(table.ids.length).fill(NaN);
    scenes.of.forEach((failure, row) => (values[failure] = scenes.rows[row]![column]!));
    const [label, unit] = withUnit(name);
    return { key: `scene.${name}`, label, unit, values };
  });
}

const UNITS: Record<string, string> = { mps: "m/s", mps2: "m/s²", m: "m", s: "s", rad: "rad" };

/** `lead_speed_mps` -> ["lead speed", "m/s"]. */
export function withUnit(name: string): [string, string] {
  const end = name.slice(name.lastIndexOf("_") + 1);
  return Object.hasOwn(UNITS, end) && end !== name ? [words(name.slice(0, -end.length - 1)), UNITS[end]!] : [words(name), ""];
}

export function titled({ label, unit }: Feature): string {
  return unit ? `${label}, ${unit}` : label;
}
