/** A failure's series as it is played: flat arrays, and time counted from the contact or the violation. */

import type { Body } from "../api/types";
import { isContact, type Collision, type Violation } from "../ui/violations";

export type Series = Body<"Series">;
/** Bodies that are no closed vehicles, and so hide nothing. */
const SHAPES: Record<string, Shape> = {
  motorcycle: "two_wheels",
  bicycle: "two_wheels",
  pedestrian: "person",
  child: "person",
  obstacle: "block",
};
export type Shape = "vehicle" | "two_wheels" | "person" | "block";
export type Part = "ego" | "striker" | "adversary" | "background";

export interface Recording {
  series: Series;
  /** What names the failure. */
  violation: Collision | Violation;
  /** What happened at 0 s. */
  moment: "contact" | "violation";
  steps: number;
  actors: number;
  /** Negative before the moment. */
  time_s: Float64Array;
  ids: string[];
  parts: Part[];
  /** How each body is drawn. */
  shape: Shape[];
  /** Whether what is behind it is hidden from the ego's sensor. */
  conceals: boolean[];
  length_m: number[];
  width_m: number[];
  /** Of `steps x actors`, as those that follow; NaN where the actor is absent. */
  x_m: Float64Array;
  y_m: Float64Array;
  heading_rad: Float64Array;
  /** Column of the road user that touched the ego, or mattered most to it; -1 if the recording lacks it, or there is none. */
  striker: number;
  /** When the adversaries were handed to the policy. */
  released_s: number;
  /** When the conflict began; null if it was not judged, or before the recording. */
  conflict_s: number | null;
}

/**
 * @param series of the failure or of its twin.
 * @param violation that names the failure; a twin is timed by it too.
 */
export function recordingOf(series: Series, violation: Collision | Violation): Recording {
  const actors = series.ids.length;
  const striker = violation.other_id === null ? -1 : series.ids.indexOf(violation.other_id);
  const after = violation.time_s ?? 0; // counts from the release
  const zero = series.released_s + after;
  const time_s = Float64Array.from(series.time_s, (time) => (time ?? Number.NaN) - zero);
  const judged = isContact(violation) ? violation.judgement?.conflict_s : null;
  const conflict_s = judged === null || judged === undefined ? null : judged - after;
  return {
    series,
    violation,
    moment: isContact(violation) ? "contact" : "violation",
    steps: time_s.length,
    actors,
    time_s,
    ids: series.ids,
    parts: series.role.map((role, i) => (i === striker ? "striker" : role === "static" ? "background" : (role as Part))),
    shape: series.body.map((body) => SHAPES[body] ?? "vehicle"),
    conceals: series.body.map((body) => !(body in SHAPES)),
    length_m: series.length_m.map((length) => length ?? 0),
    width_m: series.width_m.map((width) => width ?? 0),
    x_m: flat(series.x_m, actors),
    y_m: flat(series.y_m, actors),
    heading_rad: flat(series.heading_rad, actors),
    striker,
    released_s: -after,
    conflict_s: conflict_s !== null && conflict_s >= time_s[0]! ? conflict_s : null,
  };
}

/** Spans of time in which the ego's sensor did not see the actor. */
export function hiddenSpans(recording: Recording, actor: number): [number, number][] {
  const spans: [number, number][] = [];
  if (actor < 0) return spans;
  recording.series.visible.forEach((row, step) => {
    if (row[actor] !== false) return;
    const from = recording.time_s[step]!;
    const to = recording.time_s[Math.min(step + 1, recording.steps - 1)]!;
    const last = spans.at(-1);
    if (last !== undefined && last[1] >= from) last[1] = to;
    else spans.push([from, to]);
  });
  return spans;
}

function flat(rows: (number | null)[][], columns: number): Float64Array {
  const values = new Float64Array(rows.length * columns).fill(Number.NaN);
  rows.forEach((row, step) => row.forEach((value, i) => (values[step * columns + i] = value ?? Number.NaN)));
  return values;
}
