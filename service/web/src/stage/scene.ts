/** What one picture of the stage is made from. */

import type { Camera, View } from "./camera";
import { projectX, projectY } from "./camera";
import type { Ink } from "./colours";
import type { Instant, Poses } from "./interpolate";
import type { Recording } from "./recording";
import type { RoadPaths } from "./roads";

export const LAYERS = ["sight", "risk", "trails", "labels"] as const;
export type Layer = (typeof LAYERS)[number];
export type Layers = Record<Layer, boolean>;

/** What the ego's sensor can see at best; null for an ego that sees everything. */
export interface Sensor {
  range_m: number;
  field_of_view_rad: number;
  occlusion: boolean;
}

export interface Scene {
  ctx: CanvasRenderingContext2D;
  view: View;
  /** Device pixels per CSS pixel. */
  density: number;
  camera: Camera;
  ink: Ink;
  layers: Layers;
  recording: Recording;
  /** Whether this is the failure itself and no twin of it. */
  original: boolean;
  sensor: Sensor | null;
  roads: RoadPaths | null;
  time_s: number;
  instant: Instant;
  poses: Poses;
  /** Left, top, right and bottom of each label in the picture. */
  labels: Box[];
}

export type Box = [left: number, top: number, right: number, bottom: number];

export const pixelX = (scene: Scene, x: number) => projectX(scene.camera, scene.view, x);
export const pixelY = (scene: Scene, y: number) => projectY(scene.camera, scene.view, y);

export function present(scene: Scene, actor: number): boolean {
  return !Number.isNaN(scene.poses[3 * actor]!);
}

/** Whether the ego's sensor sees the actor; itself, always. */
export function seen(scene: Scene, actor: number): boolean {
  return scene.recording.series.visible[scene.instant.index]?.[actor] !== false;
}
