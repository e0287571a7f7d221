/** Poses of the actors between two frames. */

import type { Recording } from "./recording";

/** A time as a frame and the share of the way to the next one, 0 <= share < 1. */
export interface Instant {
  index: number;
  share: number;
}

/** Times that are so near to a frame are the frame: a step by key lands on it whatever the rounding. */
const SAME_S = 1e-6;

/** Before the first frame it is the first, after the last one the last. */
export function instantAt(times: ArrayLike<number>, time: number): Instant {
  const last = times.length - 1;
  if (last <= 0 || !(time > times[0]!)) return { index: 0, share: 0 };
  if (time >= times[last]! - SAME_S) return { index: last, share: 0 };
  let low = 0;
  let high = last;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (times[middle]! <= time + SAME_S) low = middle;
    else high = middle;
  }
  const share = (time - times[low]!) / (times[high]! - times[low]!);
  return { index: low, share: share * (times[high]! - times[low]!) < SAME_S ? 0 : share };
}

/** From one heading to another by the shorter turn. */
export function turned(from: number, to: number, share: number): number {
  const turn = Math.atan2(Math.sin(to - from), Math.cos(to - from));
  return from + turn * share;
}

/** Centre and heading of each actor, three numbers each. */
export type Poses = Float64Array;

/** Fills `poses`; an actor that is absent from one of the two frames is absent between them: NaN. */
export function posesAt(recording: Recording, { index, share }: Instant, poses: Poses): void {
  const { actors, x_m, y_m, heading_rad } = recording;
  const here = index * actors;
  const next = share > 0 ? here + actors : here;
  for (let i = 0; i < actors; i++) {
    poses[3 * i] = x_m[here + i]! + (x_m[next + i]! - x_m[here + i]!) * share;
    poses[3 * i + 1] = y_m[here + i]! + (y_m[next + i]! - y_m[here + i]!) * share;
    poses[3 * i + 2] = turned(heading_rad[here + i]!, heading_rad[next + i]!, share);
  }
}

/** Velocity over the step that leads to this time, as the time to collision is reckoned with; NaN where unknown. */
export function velocityAt(recording: Recording, { index, share }: Instant, actor: number): [number, number] {
  const to = Math.min(share > 0 ? index + 1 : Math.max(index, 1), recording.steps - 1);
  const step_s = recording.time_s[to]! - recording.time_s[to - 1]!;
  const here = to * recording.actors + actor;
  const before = here - recording.actors;
  return [(recording.x_m[here]! - recording.x_m[before]!) / step_s, (recording.y_m[here]! - recording.y_m[before]!) / step_s];
}
