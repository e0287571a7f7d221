/** The place of the contact, or of the ego as it violated the requirement. */

import { isContact } from "../ui/violations";
import { instantAt, posesAt } from "./interpolate";
import type { Recording } from "./recording";
import { pixelX, pixelY, type Scene } from "./scene";

const PLACES = new WeakMap<Recording, [number, number]>();

/** Where ego and striker touched, or where the ego was, on the map. */
export function placeOf({ recording }: Scene): [number, number] {
  let place = PLACES.get(recording);
  if (place === undefined) {
    const { violation, time_s, steps } = recording;
    const poses = new Float64Array(3 * recording.actors);
    posesAt(recording, isContact(violation) ? { index: steps - 1, share: 0 } : instantAt(time_s, 0), poses);
    const [along, across] = isContact(violation) ? [violation.contact_x_m ?? Number.NaN, violation.contact_y_m ?? Number.NaN] : [0, 0];
    const [cos, sin] = [Math.cos(poses[2]!), Math.sin(poses[2]!)];
    place = [poses[0]! + along * cos - across * sin, poses[1]! + along * sin + across * cos];
    PLACES.set(recording, place);
  }
  return place;
}

export function drawMoment(scene: Scene): void {
  if (!scene.original) return;
  const { ctx, ink } = scene;
  const [x, y] = placeOf(scene);
  const [px, py] = [pixelX(scene, x), pixelY(scene, y)];
  ctx.save();
  ctx.strokeStyle = ink["--text"];
  ctx.lineWidth = 1.5;
  ctx.beginPath();
  ctx.arc(px, py, 7, 0, 2 * Math.PI);
  for (const [dx, dy] of [[1, 1], [1, -1]] as const) {
    ctx.moveTo(px - 4 * dx, py - 4 * dy);
    ctx.lineTo(px + 4 * dx, py + 4 * dy);
  }
  ctx.stroke();
  ctx.restore();
}
