/** What part of the ground is seen, and how large: metres, y to the north, on pixels, y downwards. */

import { signal } from "../signal";
import type { Bounds } from "./geometry";

export interface Camera {
  /** Metres; the point in the middle of the view. */
  x: number;
  y: number;
  /** Pixels per metre. */
  scale: number;
}

/** Size in CSS pixels. */
export interface View {
  width: number;
  height: number;
}

export const SCALES = { least: 0.8, most: 60 };
export const ZOOM_STEP = 1.25;
const AHEAD = 0.16; // of the view's shorter side: how far the ego that is followed stays behind the middle

export const projectX = (camera: Camera, view: View, x: number) => view.width / 2 + (x - camera.x) * camera.scale;
export const projectY = (camera: Camera, view: View, y: number) => view.height / 2 - (y - camera.y) * camera.scale;
export const groundX = (camera: Camera, view: View, px: number) => camera.x + (px - view.width / 2) / camera.scale;
export const groundY = (camera: Camera, view: View, py: number) => camera.y - (py - view.height / 2) / camera.scale;

/** Larger or smaller, so that the ground under the pixel stays under it. */
export function zoomed(camera: Camera, view: View, factor: number, px: number, py: number): Camera {
  const scale = clamped(camera.scale * factor);
  const x = groundX(camera, view, px);
  const y = groundY(camera, view, py);
  return { scale, x: x - (px - view.width / 2) / scale, y: y + (py - view.height / 2) / scale };
}

/** Moved as if the ground was dragged by so many pixels. */
export function panned(camera: Camera, dx: number, dy: number): Camera {
  return { ...camera, x: camera.x - dx / camera.scale, y: camera.y + dy / camera.scale };
}

/** All of the bounds in view, with a margin around them. */
export function fitted(bounds: Bounds, view: View, margin_m: number): Camera {
  const width = bounds.right - bounds.left + 2 * margin_m;
  const height = bounds.top - bounds.bottom + 2 * margin_m;
  return {
    x: (bounds.left + bounds.right) / 2,
    y: (bounds.bottom + bounds.top) / 2,
    scale: clamped(Math.min(view.width / width, view.height / height)),
  };
}

/** What the camera follows: the place to look at, and which way is ahead. */
export interface Followed {
  x: number;
  y: number;
  heading: number;
}

/** The camera that looks a little ahead of the followed road user. */
export function following(camera: Camera, view: View, { x, y, heading }: Followed): Camera {
  const ahead = (AHEAD * Math.min(view.width, view.height)) / camera.scale;
  return { scale: camera.scale, x: x + ahead * Math.cos(heading), y: y + ahead * Math.sin(heading) };
}

function clamped(scale: number): number {
  return Math.min(Math.max(scale, SCALES.least), SCALES.most);
}

/** One camera, which several stages may share. */
export class Tripod {
  readonly camera = signal<Camera>({ x: 0, y: 0, scale: 8 });
  readonly follow = signal(true);
  /** Of the stage that was measured last; they are of one size. */
  view: View = { width: 0, height: 0 };
  private begun = false;

  /** @param around what `fit` shows. */
  constructor(private readonly around: Bounds | null) {}

  /** Called with the size of a stage; the first one chooses the scale. */
  measured(view: View): void {
    this.view = view;
    if (this.begun || view.width === 0) return;
    this.begun = true;
    if (this.around !== null) this.camera.set(fitted(this.around, view, 10));
  }

  /** What to draw with; the followed road user keeps its place in the view. */
  at(view: View, followed: Followed | null): Camera {
    const camera = this.camera.get();
    if (!this.follow.get() || followed === null || Number.isNaN(followed.x)) return camera;
    const now = following(camera, view, followed);
    Object.assign(camera, { x: now.x, y: now.y }); // letting go of it does not jump
    return camera;
  }

  zoom(factor: number, px = this.view.width / 2, py = this.view.height / 2): void {
    this.camera.set(zoomed(this.camera.get(), this.view, factor, px, py));
  }

  pan(dx: number, dy: number): void {
    this.follow.set(false);
    this.camera.set(panned(this.camera.get(), dx, dy));
  }

  fit(): void {
    this.follow.set(false);
    if (this.around !== null) this.camera.set(fitted(this.around, this.view, 10));
  }
}
