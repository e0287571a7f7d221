/** Names and numbers beside the bodies, placed so that they cover neither each other nor a body. */

import { PART_COLOURS } from "./colours";
import { placeOf } from "./moment";
import { dangerousAt, marginsAt, ttcAt } from "./risk";
import { pixelX, pixelY, present, seen, type Box, type Scene } from "./scene";

const LINE_PX = 14;
const GAPS_PX = [6, 30, 54, 86, 120]; // from the body; a line leads to a label that is not beside it
/** Right or left, below or above. */
const SIDES = [
  [1, -1],
  [-1, -1],
  [1, 1],
  [-1, 1],
] as const;

/** Where each actor's label was last: it stays there as long as it can. */
export type Sides = Int8Array;

/** Draws the labels that find room, and returns where they are; the ego's and the striker's come first. */
export function drawLabels(scene: Scene, sides: Sides): Box[] {
  const { ctx, recording, layers, camera } = scene;
  if (!layers.labels) return [];
  const taken = reserved(scene);
  const before = taken.length;
  ctx.save();
  ctx.lineJoin = "round";
  ctx.textBaseline = "middle";
  for (const part of ["ego", "striker", "adversary", "background"] as const) {
    if (part === "background" && camera.scale < 4) continue;
    for (let i = 0; i < recording.actors; i++) if (recording.parts[i] === part && present(scene, i)) drawLabel(scene, i, taken, sides);
  }
  ctx.restore();
  return taken.slice(before);
}

function drawLabel(scene: Scene, i: number, taken: Box[], sides: Sides): void {
  const { ctx, recording, poses, view, ink } = scene;
  const [px, py] = [pixelX(scene, poses[3 * i]!), pixelY(scene, poses[3 * i + 1]!)];
  if (px < 0 || py < 0 || px > view.width || py > view.height) return;
  const lines = linesOf(scene, i);
  const background = recording.parts[i] === "background";
  ctx.font = `${background ? 11 : 12}px system-ui, sans-serif`;
  const width = Math.max(...lines.map((line) => ctx.measureText(line).width));
  const height = lines.length * LINE_PX;
  const [halfX, halfY] = halves(scene, i);
  const places = SIDES.length * (background ? 1 : GAPS_PX.length);
  for (let attempt = 0; attempt < places; attempt++) {
    const place = (sides[i]! + attempt) % places;
    const [right, down] = SIDES[place % SIDES.length]!;
    const gap = GAPS_PX[Math.floor(place / SIDES.length)]!;
    const upright = halfY > halfX; // beside an upright body, above or below a lying one
    const left = (upright ? px + right * (halfX + gap) : px + right * gap) - (right < 0 ? width : 0);
    const top = (upright ? py : py + down * (halfY + gap)) - (down < 0 ? height : 0);
    const box: Box = [left, top, left + width, top + height];
    const inside = left > 2 && top > 2 && box[2] < view.width - 2 && box[3] < view.height - 2;
    if (!inside || taken.some((other) => overlap(box, other))) continue;
    sides[i] = place;
    taken.push(box);
    if (gap > GAPS_PX[0]!) lead(scene, i, px, py, box);
    ctx.strokeStyle = ink["--ground"];
    ctx.lineWidth = 3.5;
    lines.forEach((line, k) => {
      const y = top + (k + 0.5) * LINE_PX;
      ctx.fillStyle = background || k > 0 ? ink["--faint"] : ink["--text"];
      if (k > 0 && i === recording.striker && dangerousAt(scene, i)) ctx.fillStyle = ink["--bad"];
      ctx.strokeText(line, left, y);
      ctx.fillText(line, left, y);
    });
    return;
  }
}

/** A thin line from a body to the nearest place of its label. */
function lead(scene: Scene, i: number, px: number, py: number, [left, top, right, bottom]: Box): void {
  const { ctx, recording, ink } = scene;
  ctx.strokeStyle = ink[PART_COLOURS[recording.parts[i]!]];
  ctx.lineWidth = 1;
  ctx.beginPath();
  ctx.moveTo(px, py);
  ctx.lineTo(Math.min(Math.max(px, left), right), Math.min(Math.max(py, top), bottom));
  ctx.stroke();
}

/** The bodies, the moment, and the texts in the corners. */
function reserved(scene: Scene): Box[] {
  const { recording, poses, view } = scene;
  const taken: Box[] = [
    [0, 0, 130, 52],
    [view.width - 180, 0, view.width, 68],
    [0, view.height - 36, 190, view.height],
  ];
  if (scene.original) {
    const [x, y] = placeOf(scene);
    const [px, py] = [pixelX(scene, x), pixelY(scene, y)];
    taken.push([px - 8, py - 8, px + 8, py + 8]);
  }
  for (let i = 0; i < recording.actors; i++) {
    if (!present(scene, i)) continue;
    const [halfX, halfY] = halves(scene, i);
    const [px, py] = [pixelX(scene, poses[3 * i]!), pixelY(scene, poses[3 * i + 1]!)];
    taken.push([px - halfX + 1, py - halfY + 1, px + halfX - 1, py + halfY - 1]);
  }
  return taken;
}

/** Half the width and half the height of an actor's upright bounds, px. */
function halves({ recording, poses, camera }: Scene, i: number): [number, number] {
  const [cos, sin] = [Math.abs(Math.cos(poses[3 * i + 2]!)), Math.abs(Math.sin(poses[3 * i + 2]!))];
  const [length, width] = [recording.length_m[i]! * camera.scale, recording.width_m[i]! * camera.scale];
  return [(length * cos + width * sin) / 2, (length * sin + width * cos) / 2];
}

function overlap(a: Box, b: Box): boolean {
  return a[0] < b[2] && a[2] > b[0] && a[1] < b[3] && a[3] > b[1];
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
  if (along !== null && across !== null) lines.push(`RSS ${signed(along)} m along, ${signed(across)} m across`);
  return lines;
}

export function signed(value: number, digits = 1): string {
  return value.toFixed(digits).replace("-", "−");
}
