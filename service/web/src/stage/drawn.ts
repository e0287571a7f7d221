/** What a stage drew last, for tests and the browser's console: `canvas.drawn`, a copy made when it is read. */

import type { Camera } from "./camera";
import { pixelX, pixelY, present, seen, type Box, type Scene } from "./scene";
import { shownIn, type Lamp } from "./signals";

export interface Drawn {
  time_s: number;
  /** The frame at or before the time, and the share of the way to the next one. */
  index: number;
  share: number;
  camera: Camera;
  labels: Box[];
  signals: { x_m: number; y_m: number; lamp: Lamp }[];
  /** Those present; pixels are CSS pixels of the canvas. */
  actors: { id: string; part: string; x_m: number; y_m: number; heading_rad: number; px: number; py: number; seen: boolean }[];
}

const scenes = new WeakMap<HTMLCanvasElement, Scene>();

export function keepDrawn(canvas: HTMLCanvasElement, scene: Scene): void {
  canvas.dataset.time = scene.time_s.toFixed(3);
  if (!scenes.has(canvas)) Object.defineProperty(canvas, "drawn", { get: () => drawnOf(scenes.get(canvas)!) });
  scenes.set(canvas, scene);
}

function drawnOf(scene: Scene): Drawn {
  const { recording, poses, time_s, instant, camera } = scene;
  return {
    time_s,
    ...instant,
    camera: { ...camera },
    labels: [...scene.labels],
    signals: shownIn(scene).map(({ signal: { x_m, y_m }, lamp }) => ({ x_m, y_m, lamp })),
    actors: recording.ids.flatMap((id, i) => {
      if (!present(scene, i)) return [];
      const [x_m, y_m, heading_rad] = poses.subarray(3 * i, 3 * i + 3) as unknown as [number, number, number];
      return [{ id, part: recording.parts[i]!, x_m, y_m, heading_rad, px: pixelX(scene, x_m), py: pixelY(scene, y_m), seen: seen(scene, i) }];
    }),
  };
}
