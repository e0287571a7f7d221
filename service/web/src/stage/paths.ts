/** Where everybody came from, and where ego and striker will go. */

import { PART_COLOURS } from "./colours";
import { pixelX, pixelY, type Scene } from "./scene";

const TRAIL_STEPS = 30; // 3 s
const PIECES = 6; // of a trail, each paler than the one after it
const BEAD_STEPS = 5; // a dot each 0.5 s: the wider apart, the faster
const APART_PX = 12;

export function drawPaths(scene: Scene): void {
  const { recording, layers } = scene;
  if (!layers.trails) return;
  for (let i = 0; i < recording.actors; i++) {
    const part = recording.parts[i]!;
    const matters = part === "ego" || part === "striker";
    if (matters) drawCourse(scene, i);
    if (part !== "background") drawTrail(scene, i, matters);
  }
}

/** A hair line along the whole way, to come and gone. */
function drawCourse(scene: Scene, actor: number): void {
  const { ctx, recording, ink } = scene;
  ctx.save();
  ctx.strokeStyle = ink[PART_COLOURS[recording.parts[actor]!]];
  ctx.globalAlpha = 0.45;
  ctx.setLineDash([1, 4]);
  ctx.lineWidth = 1.2;
  ctx.beginPath();
  trace(scene, actor, 0, recording.steps - 1);
  ctx.stroke();
  ctx.restore();
}

function drawTrail(scene: Scene, actor: number, beads: boolean): void {
  const { ctx, recording, ink, instant, poses, camera } = scene;
  ctx.save();
  ctx.strokeStyle = ctx.fillStyle = ink[PART_COLOURS[recording.parts[actor]!]];
  ctx.lineWidth = Math.max(2, Math.min(recording.width_m[actor]! * camera.scale * 0.22, 6));
  const length = TRAIL_STEPS / PIECES;
  for (let piece = 0; piece < PIECES; piece++) {
    const to = instant.index - (PIECES - 1 - piece) * length;
    if (to < 0) continue;
    ctx.globalAlpha = (0.5 * (piece + 1)) / PIECES;
    ctx.beginPath();
    trace(scene, actor, Math.max(to - length, 0), to);
    if (piece === PIECES - 1) ctx.lineTo(pixelX(scene, poses[3 * actor]!), pixelY(scene, poses[3 * actor + 1]!));
    ctx.stroke();
  }
  if (beads) drawBeads(scene, actor);
  ctx.restore();
}

/** They stay where they are while time goes on. */
function drawBeads(scene: Scene, actor: number): void {
  const { ctx, recording, instant } = scene;
  ctx.globalAlpha = 0.8;
  const first = instant.index - (instant.index % BEAD_STEPS);
  const speed = recording.series.speed_mps[instant.index]?.[actor] ?? 0;
  if (speed * BEAD_STEPS * 0.1 * scene.camera.scale < APART_PX) return;
  for (let step = first; step >= Math.max(instant.index - TRAIL_STEPS, 0); step -= BEAD_STEPS) {
    const k = step * recording.actors + actor;
    ctx.beginPath();
    ctx.arc(pixelX(scene, recording.x_m[k]!), pixelY(scene, recording.y_m[k]!), 2.2, 0, 2 * Math.PI);
    ctx.fill();
  }
}

function trace(scene: Scene, actor: number, from: number, to: number): void {
  const { ctx, recording } = scene;
  let down = false;
  for (let step = from; step <= to; step++) {
    const k = step * recording.actors + actor;
    if (Number.isNaN(recording.x_m[k]!)) {
      down = false;
      continue;
    }
    const [x, y] = [pixelX(scene, recording.x_m[k]!), pixelY(scene, recording.y_m[k]!)];
    if (down) ctx.lineTo(x, y);
    else ctx.moveTo(x, y);
    down = true;
  }
}
