/** Linear scales between what is measured and where it is drawn. */

export interface Scale {
  low: number;
  high: number;
  /** Where a value is drawn. */
  at(value: number): number;
  /** What is drawn there. */
  of(place: number): number;
}

export function linear(low: number, high: number, from: number, to: number): Scale {
  const span = high - low || 1;
  return {
    low,
    high,
    at: (value) => from + ((value - low) / span) * (to - from),
    of: (place) => low + ((place - from) / (to - from || 1)) * span,
  };
}

/** The least round interval around all numbers, at least a little wide; [0, 1] around none. */
export function domain(values: ArrayLike<number>): [number, number] {
  let low = Infinity;
  let high = -Infinity;
  for (let i = 0; i < values.length; i++) {
    const value = values[i]!;
    if (value < low) low = value; // false for NaN
    if (value > high) high = value;
  }
  if (low > high) return [0, 1];
  if (low === high) return [low - 0.5, high + 0.5];
  const step = stepOf(high - low, 10);
  return [Math.floor(low / step + 1e-9) * step, Math.ceil(high / step - 1e-9) * step];
}

/** Round numbers within an interval, about as many as wanted. */
export function ticks(low: number, high: number, wanted: number): number[] {
  const step = stepOf(high - low, wanted);
  const found: number[] = [];
  for (let n = Math.ceil(low / step - 1e-9); n * step <= high + step * 1e-9; n++) found.push(n * step + 0); // no -0
  return found;
}

/** A tick in as few digits as its neighbours need. */
export function tickText(value: number, low: number, high: number, wanted: number): string {
  const digits = Math.max(0, -Math.floor(Math.log10(stepOf(high - low, wanted)) + 1e-9));
  return (Math.abs(value) < 1e-12 ? 0 : value).toFixed(Math.min(digits, 6)).replace("-", "−");
}

/** 1, 2 or 5 times a power of ten. */
function stepOf(span: number, wanted: number): number {
  const rough = span / Math.max(1, wanted);
  const power = 10 ** Math.floor(Math.log10(rough));
  const factor = [1, 2, 5, 10].find((each) => each * power >= rough * (1 - 1e-9)) ?? 10;
  return factor * power;
}
