/** Names and numbers beside the bodies, placed so that they do not cover each other. */

import { placeOf } from "./moment";
import { dangerousAt, marginsAt, ttcAt } from "./risk";
import { pixelX, pixelY, present, seen, type Scene } from "./scene";

const LINE_PX = 14;
const GAP_PX = 6;
const MOST = 96; // labels, and what they must not cover, of a picture
const FAR_PX = 30;
/** Right or left, below or above, near or far. */
const SIDES = [
  [1, -1, GAP_PX],
  [-1, -1, GAP_PX],
  [1, 1, GAP_PX],
  [-1, 1, GAP_PX],
  [1, -1, FAR_PX],
  [-1, -1, FAR_PX],
  [1, 1, FAR_PX],
  [-1, 1, FAR_PX],
] as const;
const taken = new Float64Array(4 * MOST);

/** The side on which each actor's label was last: it stays there as long as it can. */
export type Sides = Int8Array;

export function drawLabels(scene: Scene, sides: Sides): void {
  const { ctx, recording, layers, camera } = scene;
  if (!layers.labels) return;
  let count = reserved(scene);
  ctx.save();
  ctx.lineJoin = "round";
  ctx.textBaseline = "middle";
  for (const part of ["ego", "striker", "adversary", "background"] as const) {
    if (part === "background" && camera.scale < 4) continue;
    for (let i = 0; i < recording.actors && count < MOST; i++)
      if (recording.parts[i] === part && present(scene, i)) count = drawLabel(scene, i, count, sides);
  }
  ctx.restore();
}

function drawLabel(scene: Scene, i: number, count: number, sides: Sides): number {
  const { ctx, recording, poses, view, camera, ink } = scene;
  const px = pixelX(scene, poses[3 * i]!);
  const py = pixelY(scene, poses[3 * i + 1]!);
  if (px < 0 || py < 0 || px > view.width || py > view.height) return count;
  const lines = linesOf(scene, i);
  const background = recording.parts[i] === "background";
  ctx.font = `${background ? 11 : 12}px system-ui, sans-serif`;
  let width = 0;
  for (const line of lines) width = Math.max(width, ctx.measureText(line).width);
  const height = lines.length * LINE_PX;
  const cos = Math.abs(Math.cos(poses[3 * i + 2]!));
  const sin = Math.abs(Math.sin(poses[3 * i + 2]!));
  const halfX = ((recording.length_m[i]! * cos + recording.width_m[i]! * sin) * camera.scale) / 2;
  const halfY = ((recording.length_m[i]! * sin + recording.width_m[i]! * cos) * camera.scale) / 2;
  const upright = halfY > halfX; // beside an upright body, above or below a lying one
  const attempts = background ? 4 : SIDES.length;
  for (let attempt = 0; attempt <= attempts; attempt++) {
    const matters = attempt === attempts && (i === 0 || i === recording.striker); // is named whatever it covers
    if (attempt === attempts && !matters) break;
    const side = (sides[i]! + attempt) % attempts;
    const [right, down, gap] = SIDES[side]!;
    const left = (upright ? px + right * (halfX + gap) : px + right * gap) - (right < 0 ? width : 0);
    const top = (upright ? py : py + down * (halfY + gap)) - (down < 0 ? height : 0);
    const inside = left > 2 && top > 2 && left + width < view.width - 2 && top + height < view.height - 2;
    if (!matters && (!inside || !free(left, top, left + width, top + height, count))) continue;
    sides[i] = side;
    take(count, left, top, left + width, top + height);
    ctx.strokeStyle = ink["--ground"];
    ctx.lineWidth = 3.5;
    lines.forEach((line, k) => {
      const y = top + (k + 0.5) * LINE_PX;
      ctx.fillStyle = background || k > 0 ? ink["--faint"] : ink["--text"];
      if (k > 0 && i === recording.striker && dangerousAt(scene, i)) ctx.fillStyle = ink["--bad"];
      ctx.strokeText(line, left, y);
      ctx.fillText(line, left, y);
    });
    return count + 1;
  }
  return count;
}

/** Bodies that matter, the moment, and what stands in the corners. */
function reserved(scene: Scene): number {
  const { recording, poses, camera, view } = scene;
  take(0, 0, 0, 130, 52);
  take(1, view.width - 180, 0, view.width, 68);
  take(2, 0, view.height - 36, 190, view.height);
  let count = 3;
  if (scene.original) {
    const [x, y] = placeOf(scene);
    const [px, py] = [pixelX(scene, x), pixelY(scene, y)];
    take(count++, px - 8, py - 8, px + 8, py + 8);
  }
  for (let i = 0; i < recording.actors && count < MOST / 2; i++) {
    if (recording.parts[i] === "background" || !present(scene, i)) continue;
    const [cos, sin] = [Math.abs(Math.cos(poses[3 * i + 2]!)), Math.abs(Math.sin(poses[3 * i + 2]!))];
    const halfX = ((recording.length_m[i]! * cos + recording.width_m[i]! * sin) * camera.scale) / 2;
    const halfY = ((recording.length_m[i]! * sin + recording.width_m[i]! * cos) * camera.scale) / 2;
    const [px, py] = [pixelX(scene, poses[3 * i]!), pixelY(scene, poses[3 * i + 1]!)];
    take(count++, px - halfX + 1, py - halfY + 1, px + halfX - 1, py + halfY - 1);
  }
  return count;
}

function take(k: number, left: number, top: number, right: number, bottom: number): void {
  taken[4 * k] = left;
  taken[4 * k + 1] = top;
  taken[4 * k + 2] = right;
  taken[4 * k + 3] = bottom;
}

function linesOf(scene: Scene, i: number): string[] {
  const { recording, instant, layers } = scene;
  const { series, ids, parts, striker } = recording;
  const speed = series.speed_mps[instant.index]?.[i];
  const moves = speed === null || speed === undefined ? "" : `${speed.toFixed(1)} m/s`;
  const hidden = seen(scene, i) ? "" : " · hidden";
  if (parts[i] === "background") return [moves + hidden];
  const lines = [`${ids[i]} ${moves}${hidden}`];
  if (i !== striker || !layers.risk) return lines;
  const ttc = ttcAt(scene, i);
  if (ttc !== null) lines.push(`TTC ${ttc.toFixed(1)} s`);
  const { along, across } = marginsAt(scene, i);
  if (along !== null && across !== null) lines.push(`RSS ${signed(along)} m along, ${signed(across)} across`);
  return lines;
}

export function signed(value: number, digits = 1): string {
  return value.toFixed(digits).replace("-", "−");
}

function free(left: number, top: number, right: number, bottom: number, count: number): boolean {
  for (let k = 0; k < count; k++) {
    if (left < taken[4 * k + 2]! && right > taken[4 * k]! && top < taken[4 * k + 3]! && bottom > taken[4 * k + 1]!) return false;
  }
  return true;
}
