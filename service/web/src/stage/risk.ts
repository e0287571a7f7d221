/** What the risk measures say of ego and striker: where both would be by their present motion, and the RSS margin. */

import { velocityAt } from "./interpolate";
import { PART_COLOURS, type Colour } from "./colours";
import { pixelX, pixelY, present, type Scene } from "./scene";

/** At this or later there is no collision course; `risk_sac.risk.rss` caps it so. */
export const TTC_CAP_S = 10;
/** RSS margins are capped at it. */
export const RSS_CAP_M = 50;
const HORIZON_S = 2; // how far ahead the motion is drawn where no bodies would touch
const LONGEST_S = 4;

/** Seconds until ego and actor touch; null where they are on no collision course. */
export function ttcAt(scene: Pick<Scene, "recording" | "instant">, actor: number): number | null {
  const ttc = scene.recording.series.ttc_s[scene.instant.index]?.[actor];
  return ttc === null || ttc === undefined || ttc >= TTC_CAP_S ? null : ttc;
}

/** RSS margins along and across the ego's axis; null where they are at their cap. */
export function marginsAt({ recording, instant }: Pick<Scene, "recording" | "instant">, actor: number) {
  const below = (rows: (number | null)[][]) => {
    const margin = rows[instant.index]?.[actor];
    return margin === null || margin === undefined || margin >= RSS_CAP_M ? null : margin;
  };
  return { along: below(recording.series.rss_longitudinal_m), across: below(recording.series.rss_lateral_m) };
}

/** RSS calls it dangerous where both margins are negative. */
export function dangerousAt(scene: Pick<Scene, "recording" | "instant">, actor: number): boolean {
  const { along, across } = marginsAt(scene, actor);
  return along !== null && across !== null && along < 0 && across < 0;
}

export function drawRisk(scene: Scene): void {
  const striker = scene.recording.striker;
  if (!scene.layers.risk || striker < 0 || !present(scene, 0) || !present(scene, striker)) return;
  drawMargin(scene, striker);
  const ttc = ttcAt(scene, striker);
  drawMotion(scene, 0, ttc);
  drawMotion(scene, striker, ttc);
}

/** An arrow along the motion, and the body where they would touch. */
function drawMotion(scene: Scene, actor: number, ttc: number | null): void {
  const { ctx, recording, poses, ink, camera } = scene;
  const ahead_s = Math.min(ttc ?? HORIZON_S, LONGEST_S);
  const [vx, vy] = velocityAt(recording, scene.instant, actor);
  if (Number.isNaN(vx) || Math.hypot(vx, vy) < 0.1) return;
  const x = poses[3 * actor]!;
  const y = poses[3 * actor + 1]!;
  ctx.save();
  ctx.strokeStyle = ink[PART_COLOURS[recording.parts[actor]!]];
  ctx.lineWidth = 1.5;
  ctx.setLineDash([7, 4]);
  ctx.globalAlpha = 0.85;
  ctx.beginPath();
  ctx.moveTo(pixelX(scene, x), pixelY(scene, y));
  ctx.lineTo(pixelX(scene, x + vx * ahead_s), pixelY(scene, y + vy * ahead_s));
  ctx.stroke();
  if (ttc !== null && ttc <= LONGEST_S) {
    ctx.translate(pixelX(scene, x + vx * ahead_s), pixelY(scene, y + vy * ahead_s));
    ctx.rotate(-poses[3 * actor + 2]!);
    const length = recording.length_m[actor]! * camera.scale;
    const width = recording.width_m[actor]! * camera.scale;
    ctx.setLineDash([3, 3]);
    ctx.strokeRect(-length / 2, -width / 2, length, width);
  }
  ctx.restore();
}

/** A bar ahead of the ego, as long as the margin along its way: of warning where it lacks, red and hatched where RSS calls that dangerous. */
function drawMargin(scene: Scene, striker: number): void {
  const { ctx, recording, poses, camera, ink } = scene;
  const margin = marginsAt(scene, striker).along;
  if (margin === null) return;
  const dangerous = dangerousAt(scene, striker);
  const colour: Colour = dangerous ? "--bad" : margin < 0 ? "--warn" : "--good";
  const length = Math.abs(margin) * camera.scale;
  const width = recording.width_m[0]! * camera.scale;
  ctx.save();
  ctx.translate(pixelX(scene, poses[0]!), pixelY(scene, poses[1]!));
  ctx.rotate(-poses[2]!);
  ctx.translate((recording.length_m[0]! * camera.scale) / 2, 0);
  ctx.fillStyle = ctx.strokeStyle = ink[colour];
  ctx.globalAlpha = dangerous ? 0.18 : 0.1;
  ctx.fillRect(0, -width / 2, length, width);
  ctx.globalAlpha = 0.9;
  ctx.lineWidth = 1.5;
  ctx.beginPath();
  ctx.rect(0, -width / 2, length, width);
  ctx.stroke();
  if (dangerous) {
    ctx.clip();
    ctx.globalAlpha = 0.5;
    ctx.beginPath();
    for (let x = -width; x < length; x += 7) {
      ctx.moveTo(x, width / 2);
      ctx.lineTo(x + width, -width / 2);
    }
    ctx.stroke();
  }
  ctx.restore();
}
