/** A failure's series as it is played: flat arrays, and time counted from the contact. */

import type { Body } from "../api/types";

export type Series = Body<"Series">;
export type Collision = Body<"Collision">;
export type Part = "ego" | "striker" | "adversary" | "background";

export interface Recording {
  series: Series;
  steps: number;
  actors: number;
  /** Negative before the contact. */
  time_s: Float64Array;
  ids: string[];
  parts: Part[];
  pedestrian: boolean[];
  length_m: number[];
  width_m: number[];
  /** Of `steps x actors`, as those that follow; NaN where the actor is absent. */
  x_m: Float64Array;
  y_m: Float64Array;
  heading_rad: Float64Array;
  /** Column of who touched the ego; -1 if the recording lacks it. */
  striker: number;
  /** When the adversaries were handed to the policy. */
  released_s: number;
  /** When the conflict began; null if nobody judged it, or before the recording. */
  conflict_s: number | null;
}

/**
 * @param series of the failure or of its twin.
 * @param collision of the failure; a twin is timed by it too.
 */
export function recordingOf(series: Series, collision: Collision): Recording {
  const actors = series.ids.length;
  const striker = series.ids.indexOf(collision.other_id);
  const after = collision.time_s ?? 0; // the contact counts from the release
  const zero = series.released_s + after;
  const time_s = Float64Array.from(series.time_s, (time) => (time ?? Number.NaN) - zero);
  const judged = collision.judgement?.conflict_s;
  const conflict_s = judged === null || judged === undefined ? null : judged - after;
  return {
    series,
    steps: time_s.length,
    actors,
    time_s,
    ids: series.ids,
    parts: series.role.map((role, i) => (i === striker ? "striker" : (role as Part))),
    pedestrian: series.kind.map((kind) => kind === "pedestrian"),
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
