/** One picture of the stage, from the ground up. */

import { drawBodies } from "./bodies";
import { drawMoment } from "./moment";
import { roundLength } from "./geometry";
import { drawLabels, signed, type Sides } from "./labels";
import { drawPaths } from "./paths";
import { drawRisk } from "./risk";
import { drawGround } from "./roads";
import type { Scene } from "./scene";
import { drawSignals, LAMP_COLOURS } from "./signals";
import { drawShade, drawSightLines } from "./sight";

export function drawPicture(scene: Scene, sides: Sides): void {
  const { ctx, density } = scene;
  ctx.setTransform(density, 0, 0, density, 0, 0);
  drawGround(scene);
  drawShade(scene);
  drawSignals(scene);
  drawPaths(scene);
  drawMoment(scene);
  drawSightLines(scene);
  drawRisk(scene);
  drawBodies(scene);
  scene.labels = drawLabels(scene, sides);
  drawScaleBar(scene);
  drawTime(scene);
  drawSignal(scene);
}

function drawScaleBar({ ctx, view, camera, ink }: Scene): void {
  const metres = roundLength(Math.min(160, view.width / 4) / camera.scale);
  const length = metres * camera.scale;
  const [x, y] = [16, view.height - 14];
  ctx.save();
  ctx.strokeStyle = ctx.fillStyle = ink["--text"];
  ctx.lineWidth = 1.5;
  ctx.beginPath();
  ctx.moveTo(x, y - 5);
  ctx.lineTo(x, y);
  ctx.lineTo(x + length, y);
  ctx.lineTo(x + length, y - 5);
  ctx.stroke();
  ctx.font = "12px system-ui, sans-serif";
  ctx.textAlign = "center";
  halo(ctx, ink["--ground"], `${metres} m`, x + length / 2, y - 7);
  ctx.restore();
}

function drawTime({ ctx, time_s, ink, recording }: Scene): void {
  const ended = time_s > recording.time_s.at(-1)! + 0.05;
  ctx.save();
  ctx.font = "600 18px system-ui, sans-serif";
  ctx.fillStyle = ink["--text"];
  halo(ctx, ink["--ground"], `${signed(time_s, 2)} s`, 14, 26);
  ctx.font = "12px system-ui, sans-serif";
  ctx.fillStyle = ink["--faint"];
  const when = ended ? "the recording has ended" : `${Math.abs(time_s) < 0.005 ? "at" : time_s < 0 ? "to" : "after"} the ${recording.moment}`;
  halo(ctx, ink["--ground"], when, 14, 43);
  ctx.restore();
}

const LAMPS = ["red", "yellow", "green"] as const;

/** The signal ahead of the ego, as a head of three lamps and in words. */
function drawSignal({ ctx, view, recording, instant, ink }: Scene): void {
  const colour = recording.series.signal[instant.index];
  if (colour === undefined || colour === "none") return;
  const [x, y] = [view.width - 32, 12];
  ctx.save();
  ctx.fillStyle = "#20242c";
  ctx.beginPath();
  ctx.roundRect(x, y, 20, 52, 6);
  ctx.fill();
  LAMPS.forEach((lamp, k) => {
    ctx.beginPath();
    ctx.arc(x + 10, y + 10 + 16 * k, 6, 0, 2 * Math.PI);
    ctx.fillStyle = lamp === colour ? LAMP_COLOURS[lamp] : "#4a505c";
    ctx.fill();
  });
  ctx.font = "12px system-ui, sans-serif";
  ctx.textAlign = "right";
  ctx.fillStyle = ink["--text"];
  halo(ctx, ink["--ground"], `${colour} ahead of the ego`, x - 8, y + 30);
  ctx.restore();
}

function halo(ctx: CanvasRenderingContext2D, ground: string, text: string, x: number, y: number): void {
  ctx.save();
  ctx.strokeStyle = ground;
  ctx.lineWidth = 3.5;
  ctx.lineJoin = "round";
  ctx.strokeText(text, x, y);
  ctx.restore();
  ctx.fillText(text, x, y);
}
