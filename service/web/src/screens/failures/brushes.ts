/** Brushes: on each axis, the interval that failures shall lie in. */

import type { Feature } from "./features";

/** Both ends belong to it; an infinite end is open. */
export type Interval = readonly [number, number];
/** By a feature's key. */
export type Brushes = ReadonlyMap<string, Interval>;

export const NONE: Brushes = new Map();

/** `closing:5:12,scene.friction::0.8` and back; what cannot be read is left out. */
export function parsed(text: string): Brushes {
  const found = new Map<string, Interval>();
  for (const part of text.split(",")) {
    const [key, low, high] = part.split(":");
    const interval: Interval = [low ? Number(low) : -Infinity, high ? Number(high) : Infinity];
    if (key && high !== undefined && bounded(interval)) found.set(key, interval);
  }
  return found;
}

export function written(brushes: Brushes): string {
  return [...brushes].map(([key, [low, high]]) => `${key}:${end(low)}:${end(high)}`).join(",");
}

/** The brushes with that of one axis set anew, or taken away by null or where both ends are open. */
export function brushed(brushes: Brushes, key: string, interval: Interval | null): Brushes {
  const next = new Map(brushes);
  if (interval !== null && bounded(interval)) next.set(key, interval);
  else next.delete(key);
  return next;
}

/** Those of the failures that lie in every brush; one without a value on a brushed axis lies in none. */
export function within(failures: readonly number[], brushes: Brushes, features: readonly Feature[]): readonly number[] {
  const tests = features.flatMap(({ key, values }) => {
    const interval = brushes.get(key);
    return interval ? [{ values, low: interval[0], high: interval[1] }] : [];
  });
  if (!tests.length) return failures;
  return failures.filter((i) => tests.every(({ values, low, high }) => values[i]! >= low && values[i]! <= high));
}

/** A dragged interval in as many digits as its axis shows apart, so that addresses stay short. */
export function rounded([a, b]: Interval, span: number): Interval {
  const digits = Math.min(6, Math.max(0, 3 - Math.ceil(Math.log10(span || 1))));
  const round = (value: number) => Number(value.toFixed(digits));
  return [round(Math.min(a, b)), round(Math.max(a, b))];
}

function bounded([low, high]: Interval): boolean {
  return Number.isFinite(low) || Number.isFinite(high);
}

function end(value: number): string {
  return Number.isFinite(value) ? String(value) : "";
}
