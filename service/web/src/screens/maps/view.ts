/** What part of a map is seen: metres, y to the north, on pixels, y downwards; each axis has a scale. Pure. */

import type { Bounds } from "../../stage/geometry";

export interface MapView {
  /** Metres; the point in the middle. */
  x: number;
  y: number;
  /** Pixels per metre. */
  scaleX: number;
  scaleY: number;
}

export interface Size {
  width: number;
  height: number;
}

interface Point {
  x_m: number;
  y_m: number;
}

/** A point as it is drawn: those of one place stand beside each other. */
export interface Mark<P extends Point> {
  point: P;
  /** Pixels to the right of its place. */
  aside: number;
}

const ASIDE = 13; // pixels between the marks of one place
const MARGIN = 24; // pixels around the whole map
const LONG = 6; // a map so many times as long as it is wide is drawn with axes apart
const MOST_APART = 40;
const MOST_SCALE = 40;

/** All of the map; a long one has its axes scaled apart if it may. */
export function whole(bounds: Bounds, { width, height }: Size, apart: boolean): MapView {
  const fitX = Math.max(1, width - 2 * MARGIN) / Math.max(1, bounds.right - bounds.left);
  const fitY = Math.max(1, height - 2 * MARGIN) / Math.max(1, bounds.top - bounds.bottom);
  const least = Math.min(fitX, fitY);
  const most = apart ? least * MOST_APART : least;
  return {
    x: (bounds.left + bounds.right) / 2,
    y: (bounds.bottom + bounds.top) / 2,
    scaleX: Math.min(fitX, most, MOST_SCALE),
    scaleY: Math.min(fitY, most, MOST_SCALE),
  };
}

/** Whether a map is so long that it would be a thin line. */
export function isLong({ left, right, bottom, top }: Bounds): boolean {
  const [wide, high] = [Math.max(1, right - left), Math.max(1, top - bottom)];
  return Math.max(wide, high) > LONG * Math.min(wide, high);
}

/** How many times as large one axis is drawn as the other, and which. */
export function apartOf({ scaleX, scaleY }: MapView): { times: number; axis: "x" | "y" } {
  return scaleY >= scaleX ? { times: scaleY / scaleX, axis: "y" } : { times: scaleX / scaleY, axis: "x" };
}

export const pixelX = (view: MapView, { width }: Size, x: number) => width / 2 + (x - view.x) * view.scaleX;
export const pixelY = (view: MapView, { height }: Size, y: number) => height / 2 - (y - view.y) * view.scaleY;

/** Nearer or farther, so that the ground under the pixel stays under it. */
export function zoomed(view: MapView, { width, height }: Size, factor: number, px: number, py: number): MapView {
  const times = Math.max(1e-3, Math.min(factor, MOST_SCALE / Math.min(view.scaleX, view.scaleY)));
  const [scaleX, scaleY] = [view.scaleX * times, view.scaleY * times];
  const [dx, dy] = [px - width / 2, py - height / 2];
  return { scaleX, scaleY, x: view.x + dx / view.scaleX - dx / scaleX, y: view.y - dy / view.scaleY + dy / scaleY };
}

/** Moved as if the ground was dragged by so many pixels. */
export function panned(view: MapView, dx: number, dy: number): MapView {
  return { ...view, x: view.x - dx / view.scaleX, y: view.y + dy / view.scaleY };
}

/** With the point in the middle, unless it is well in sight. */
export function showing(view: MapView, size: Size, { x_m, y_m }: Point): MapView {
  const [px, py] = [pixelX(view, size, x_m), pixelY(view, size, y_m)];
  const inside = px > MARGIN && px < size.width - MARGIN && py > MARGIN && py < size.height - MARGIN;
  return inside ? view : { ...view, x: x_m, y: y_m };
}

/** The marks of some points. */
export function marksOf<P extends Point>(points: readonly P[]): Mark<P>[] {
  const places = new Map<string, P[]>();
  for (const point of points) {
    const place = `${point.x_m} ${point.y_m}`;
    places.set(place, [...(places.get(place) ?? []), point]);
  }
  return [...places.values()].flatMap((at) => at.map((point, i) => ({ point, aside: ASIDE * (i - (at.length - 1) / 2) })));
}

/** The point whose mark is the nearest one within so many pixels. */
export function hit<P extends Point>(marks: readonly Mark<P>[], view: MapView, size: Size, at: { px: number; py: number }, within: number): P | undefined {
  let least = within;
  let nearest: P | undefined;
  for (const { point, aside } of marks) {
    const away = Math.hypot(pixelX(view, size, point.x_m) + aside - at.px, pixelY(view, size, point.y_m) - at.py);
    if (away <= least) [least, nearest] = [away, point];
  }
  return nearest;
}
