/** The actors: bodies to scale, each part with a colour and a mark of its own, dashed while the ego does not see it. */

import { PART_COLOURS } from "./colours";
import { pixelX, pixelY, present, seen, type Scene } from "./scene";

const LEAST_PERSON_PX = 6; // a person's half width is 0.25 m: too few pixels to be seen
const DASH = [4, 3];
const NO_DASH: number[] = [];

/** Background first, the ego last, so that what matters is on top. */
export function drawBodies(scene: Scene): void {
  const { recording } = scene;
  for (const part of ["background", "adversary", "striker", "ego"] as const)
    for (let i = 0; i < recording.actors; i++) if (recording.parts[i] === part && present(scene, i)) drawActor(scene, i);
}

function drawActor(scene: Scene, i: number): void {
  const { ctx, recording, poses, camera, ink } = scene;
  const part = recording.parts[i]!;
  const visible = seen(scene, i);
  ctx.save();
  ctx.translate(pixelX(scene, poses[3 * i]!), pixelY(scene, poses[3 * i + 1]!));
  ctx.rotate(-poses[3 * i + 2]!);
  ctx.fillStyle = ctx.strokeStyle = ink[PART_COLOURS[part]];
  ctx.setLineDash(visible ? NO_DASH : DASH);
  ctx.lineWidth = part === "background" ? 1 : 1.6;
  if (recording.shape[i] === "person") drawPerson(scene, recording.width_m[i]! * camera.scale, visible);
  else drawVehicle(scene, i, recording.length_m[i]! * camera.scale, recording.width_m[i]! * camera.scale, visible);
  ctx.restore();
}

/** Nose to the right; the window tells front from back. */
function drawVehicle(scene: Scene, i: number, length: number, width: number, visible: boolean): void {
  const { ctx, recording, ink } = scene;
  const part = recording.parts[i]!;
  const front = Math.min(width * 0.35, length * 0.12);
  ctx.beginPath();
  ctx.roundRect(-length / 2, -width / 2, length, width, [width * 0.15, front, front, width * 0.15]);
  ctx.globalAlpha = visible ? (part === "background" ? 0.55 : 1) : 0.18;
  ctx.fill();
  ctx.globalAlpha = 1;
  ctx.stroke();
  ctx.setLineDash(NO_DASH);
  if (visible && part === "striker") hatch(scene, length, width);
  ctx.strokeStyle = ctx.fillStyle = visible ? ink["--surface"] : ctx.strokeStyle;
  if (recording.shape[i] !== "block") drawHeading(ctx, length, width);
  if (part === "ego") disc(ctx, -length * 0.12, 0, width * 0.2, true);
  if (part === "adversary") disc(ctx, -length * 0.12, 0, width * 0.17, false);
}

/** An arrow head behind the nose. */
function drawHeading(ctx: CanvasRenderingContext2D, length: number, width: number): void {
  const nose = length / 2 - Math.min(width, length) * 0.22;
  const back = nose - Math.min(width * 0.45, length * 0.25);
  ctx.beginPath();
  ctx.moveTo(back, -width * 0.3);
  ctx.lineTo(nose, 0);
  ctx.lineTo(back, width * 0.3);
  ctx.lineWidth = Math.max(1, width * 0.08);
  ctx.stroke();
}

function hatch(scene: Scene, length: number, width: number): void {
  const { ctx, ink } = scene;
  ctx.save();
  ctx.clip();
  ctx.strokeStyle = ink["--surface"];
  ctx.globalAlpha = 0.5;
  ctx.lineWidth = Math.max(1, width * 0.1);
  ctx.beginPath();
  for (let x = -length / 2 - width; x < length * 0.18; x += Math.max(width * 0.38, 3)) {
    ctx.moveTo(x, width / 2);
    ctx.lineTo(x + width, -width / 2);
  }
  ctx.stroke();
  ctx.restore();
}

/** Shoulders, a head and a nose; never smaller than what can be seen. */
function drawPerson(scene: Scene, width: number, visible: boolean): void {
  const { ctx, ink } = scene;
  const size = Math.max(width / 2, LEAST_PERSON_PX);
  ctx.beginPath();
  ctx.ellipse(0, 0, size * 0.62, size * 1.15, 0, 0, 2 * Math.PI);
  ctx.globalAlpha = visible ? 0.55 : 0.15;
  ctx.fill();
  ctx.globalAlpha = 1;
  ctx.stroke();
  ctx.setLineDash(NO_DASH);
  ctx.beginPath();
  ctx.moveTo(size * 0.5, -size * 0.5);
  ctx.lineTo(size * 1.5, 0);
  ctx.lineTo(size * 0.5, size * 0.5);
  ctx.stroke();
  disc(ctx, 0, 0, size * 0.6, visible);
  if (!visible) return;
  ctx.strokeStyle = ink["--surface"];
  ctx.lineWidth = 1;
  ctx.stroke();
}

function disc(ctx: CanvasRenderingContext2D, x: number, y: number, radius: number, full: boolean): void {
  ctx.beginPath();
  ctx.arc(x, y, radius, 0, 2 * Math.PI);
  if (full) ctx.fill();
  else ctx.stroke();
}
