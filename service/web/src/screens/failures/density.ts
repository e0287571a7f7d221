/** Thousands of lines as a picture of how many lie where: quicker than strokes, and it does not clog. */

export const MANY = 1200; // from so many lines on strokes would take longer, and hide each other

/** Points of a line at the axes, in px; NaN where it has none. */
export type PointAt = (line: number, axis: number) => number;

export interface Stack {
  width: number;
  axes: number;
  /** From one axis to the next; the first lies half of it below the upper edge. */
  pitch: number;
}

/** How many lines pass through each pixel, row by row: each line goes straight from axis to axis. */
export function counted(lines: readonly number[], { width, axes, pitch }: Stack, at: PointAt): Uint16Array {
  const counts = new Uint16Array(width * axes * pitch);
  const places = new Float64Array(lines.length);
  const next = new Float64Array(lines.length);
  for (let n = 0; n < lines.length; n++) next[n] = at(lines[n]!, 0);
  for (let axis = 0; axis + 1 < axes; axis++) {
    places.set(next);
    for (let n = 0; n < lines.length; n++) next[n] = at(lines[n]!, axis + 1);
    const above = Math.floor((axis + 0.5) * pitch);
    for (let n = 0; n < lines.length; n++) {
      const [from, to] = [places[n]!, next[n]!];
      if (from !== from || to !== to) continue;
      const step = (to - from) / pitch;
      for (let y = 0, x = from; y < pitch; y++, x += step) {
        const begin = (above + y) * width;
        const left = Math.max(0, Math.floor(step < 0 ? x + step : x));
        const right = Math.min(width - 1, Math.floor(step < 0 ? x : x + step));
        for (let pixel = begin + left; pixel <= begin + right; pixel++) counts[pixel]!++;
      }
    }
  }
  return counts;
}

export type Colour = readonly [red: number, green: number, blue: number];

/** The most lines that pass one pixel. */
export function highestOf(counts: Uint16Array): number {
  let highest = 1;
  for (let i = 0; i < counts.length; i++) if (counts[i]! > highest) highest = counts[i]!;
  return highest;
}

/** How much of a pixel a line covers, and how much the most lines there are anywhere. */
export interface Cover {
  least: number;
  most: number;
  highest: number;
}

/** Lays counts over a picture of RGBA pixels; the more lines, the less is seen through them, by the logarithm. */
export function laidOver(pixels: Uint8ClampedArray, counts: Uint16Array, [red, green, blue]: Colour, { least, most, highest }: Cover): void {
  const covers = Float64Array.from({ length: highest + 1 }, (_, n) => (n ? least + (most - least) * (Math.log(n) / Math.log(highest + 1)) : 0));
  for (let i = 0; i < counts.length; i++) {
    if (!counts[i]) continue;
    const cover = covers[counts[i]!]!;
    const p = 4 * i;
    const below = (pixels[p + 3]! / 255) * (1 - cover);
    const alpha = cover + below;
    pixels[p] = (red * cover + pixels[p]! * below) / alpha;
    pixels[p + 1] = (green * cover + pixels[p + 1]! * below) / alpha;
    pixels[p + 2] = (blue * cover + pixels[p + 2]! * below) / alpha;
    pixels[p + 3] = 255 * alpha;
  }
}

/** `#rrggbb` as numbers. */
export function colourOf(hex: string): Colour {
  const value = parseInt(hex.slice(1), 16);
  return [(value >> 16) & 255, (value >> 8) & 255, value & 255];
}
