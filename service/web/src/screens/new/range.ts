/** Intervals on a scale, and how two thumbs move them. */

export interface Range {
  low: number;
  high: number;
}

export interface Scale extends Range {
  step: number;
}

/** The smallest range that holds all of them. */
export function hull(ranges: readonly Range[]): Range {
  return { low: Math.min(...ranges.map(({ low }) => low)), high: Math.max(...ranges.map(({ high }) => high)) };
}

/** About a hundred steps of a round size; whole ones where the field counts something. */
export function scaleOf({ low, high }: Range, counts = false): Scale {
  if (counts || low >= high) return { low, high, step: 1 };
  const rough = (high - low) / 100;
  const power = 10 ** Math.floor(Math.log10(rough));
  const factor = [1, 2, 5, 10].find((each) => each * power >= rough * 0.999)!;
  return { low, high, step: rounded(factor * power) };
}

/** The range after one of its ends was moved to a value: it stays on the scale, and the ends never pass each other. */
export function moved(range: Range, end: keyof Range, value: number, scale: Scale): Range {
  const onScale = snapped(value, scale);
  if (end === "low") return { low: Math.min(onScale, range.high), high: range.high };
  return { low: range.low, high: Math.max(onScale, range.low) };
}

/** The nearest step, counted from zero; the ends of the scale can be reached though they lie between two steps. */
export function snapped(value: number, { low, high, step }: Scale): number {
  if (value <= low) return low;
  if (value >= high) return high;
  const near = rounded(Math.round(value / step) * step);
  return Math.min(high, Math.max(low, near));
}

/** Where a value lies on a scale, from 0 to 1. */
export function share(value: number, { low, high }: Range): number {
  return high > low ? Math.min(1, Math.max(0, (value - low) / (high - low))) : 0;
}

export function same(one: Range, other: Range): boolean {
  return one.low === other.low && one.high === other.high;
}

export function apart(one: Range, other: Range): boolean {
  return one.low > other.high || one.high < other.low;
}

function rounded(value: number): number {
  return Number(value.toPrecision(12)); // 0.1 · 3 shall be 0.3
}
