/** Where a value stands on a short axis. Pure. */

/** The end of an axis from 0: 1, 2 or 5 times a power of ten that nothing goes beyond. */
export function niceEnd(most: number): number {
  if (!(most > 0)) return 1;
  const power = 10 ** Math.floor(Math.log10(most));
  const end = [1, 2, 2.5, 5, 10].find((step) => step * power >= most * (1 - 1e-9))!;
  return Number((end * power).toPrecision(3));
}

/** Per cent of the way from low to high; what lies outside stands at the end. */
export function percentAlong(value: number, low: number, high: number): number {
  if (high <= low) return 0;
  return Math.min(100, Math.max(0, (100 * (value - low)) / (high - low)));
}
