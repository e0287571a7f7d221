/** What the ego can see: the ground in view, shadows behind bodies, and a line of sight to each other actor. */

import { corners, entry, shadow } from "./geometry";
import { PART_COLOURS } from "./colours";
import { pixelX, pixelY, present, seen, type Scene } from "./scene";

const body = new Float64Array(8);
const behind = new Float64Array(8);

/** Shades the ground that the ego does not see. */
export function drawShade(scene: Scene): void {
  const { ctx, view, poses, camera, sensor, recording, ink } = scene;
  if (!scene.layers.sight || sensor === null || !present(scene, 0)) return;
  const eyeX = poses[0]!;
  const eyeY = poses[1]!;
  ctx.save();
  ctx.fillStyle = ink["--shade"];
  const range = sensor.range_m * camera.scale;
  ctx.beginPath();
  ctx.rect(0, 0, view.width, view.height);
  sector(scene, range);
  ctx.fill("evenodd");
  ctx.beginPath();
  sector(scene, range);
  ctx.clip();
  ctx.beginPath();
  const beyond = 3 * sensor.range_m; // so that the straight far side lies outside of the range
  for (let i = 1; sensor.occlusion && i < recording.actors; i++) {
    if (!recording.conceals[i] || !present(scene, i)) continue;
    place(scene, i);
    if (!shadow(eyeX, eyeY, body, beyond, behind)) continue;
    ctx.moveTo(pixelX(scene, behind[0]!), pixelY(scene, behind[1]!));
    for (let k = 1; k < 4; k++) ctx.lineTo(pixelX(scene, behind[2 * k]!), pixelY(scene, behind[2 * k + 1]!));
    ctx.closePath();
  }
  ctx.fill();
  ctx.restore();
}

function sector({ ctx, poses, sensor, ...scene }: Scene, range: number): void {
  const x = pixelX(scene as Scene, poses[0]!);
  const y = pixelY(scene as Scene, poses[1]!);
  const half = sensor!.field_of_view_rad / 2;
  const whole = half >= Math.PI - 1e-6;
  if (whole) ctx.moveTo(x + range * Math.cos(-poses[2]! - half), y + range * Math.sin(-poses[2]! - half));
  else ctx.moveTo(x, y);
  ctx.arc(x, y, range, -poses[2]! - half, -poses[2]! + half);
  ctx.closePath();
}

const DOTS = [2, 5];
const LINE: number[] = [];

/** A thin line to a road user in sight; to a hidden one, solid as far as the occluder, then dotted. */
export function drawSightLines(scene: Scene): void {
  const { ctx, poses, recording, ink, layers } = scene;
  if (!layers.sight || !present(scene, 0)) return;
  const eyeX = poses[0]!;
  const eyeY = poses[1]!;
  ctx.save();
  for (let i = 1; i < recording.actors; i++) {
    if (!present(scene, i)) continue;
    const part = recording.parts[i]!;
    const toX = poses[3 * i]!;
    const toY = poses[3 * i + 1]!;
    const whole = seen(scene, i);
    const share = whole ? 1 : freeShare(scene, i);
    if (!whole && share === 1) continue; // out of range: nothing stands between
    ctx.strokeStyle = ink[PART_COLOURS[part]];
    ctx.globalAlpha = part === "striker" ? 0.9 : part === "adversary" ? 0.6 : 0.3;
    ctx.lineWidth = part === "striker" ? 1.4 : 1;
    line(scene, eyeX, eyeY, eyeX + (toX - eyeX) * share, eyeY + (toY - eyeY) * share, LINE);
    if (whole) continue;
    line(scene, eyeX + (toX - eyeX) * share, eyeY + (toY - eyeY) * share, toX, toY, DOTS);
    cross(scene, eyeX + (toX - eyeX) * share, eyeY + (toY - eyeY) * share);
  }
  ctx.restore();
}

/** The share of the way to an actor up to the first body in between. */
function freeShare({ poses, recording }: Scene, actor: number): number {
  let share = 1;
  for (let i = 1; i < recording.actors; i++) {
    if (i === actor || !recording.conceals[i] || Number.isNaN(poses[3 * i]!)) continue;
    const [x, y, heading] = [poses[3 * i]!, poses[3 * i + 1]!, poses[3 * i + 2]!];
    const meets = entry(poses[0]!, poses[1]!, poses[3 * actor]!, poses[3 * actor + 1]!, x, y, heading, recording.length_m[i]!, recording.width_m[i]!);
    share = Math.min(share, meets);
  }
  return share;
}

function line(scene: Scene, fromX: number, fromY: number, toX: number, toY: number, dash: number[]): void {
  const { ctx } = scene;
  ctx.setLineDash(dash);
  ctx.beginPath();
  ctx.moveTo(pixelX(scene, fromX), pixelY(scene, fromY));
  ctx.lineTo(pixelX(scene, toX), pixelY(scene, toY));
  ctx.stroke();
}

function cross(scene: Scene, x: number, y: number): void {
  const { ctx } = scene;
  const [px, py] = [pixelX(scene, x), pixelY(scene, y)];
  ctx.setLineDash(LINE);
  ctx.beginPath();
  ctx.moveTo(px - 4, py - 4);
  ctx.lineTo(px + 4, py + 4);
  ctx.moveTo(px - 4, py + 4);
  ctx.lineTo(px + 4, py - 4);
  ctx.stroke();
}

function place({ poses, recording }: Scene, i: number): void {
  corners(poses[3 * i]!, poses[3 * i + 1]!, poses[3 * i + 2]!, recording.length_m[i]!, recording.width_m[i]!, body);
}
