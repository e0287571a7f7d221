/** The place of the contact. */

import { posesAt } from "./interpolate";
import type { Recording } from "./recording";
import { pixelX, pixelY, type Scene } from "./scene";

const CONTACT = new WeakMap<Recording, [number, number]>();

/** Where ego and striker touched, on the map. */
export function contactOf({ recording, collision }: Scene): [number, number] {
  let place = CONTACT.get(recording);
  if (place === undefined) {
    const poses = new Float64Array(3 * recording.actors);
    posesAt(recording, { index: recording.steps - 1, share: 0 }, poses);
    const [along, across] = [collision.contact_x_m ?? Number.NaN, collision.contact_y_m ?? Number.NaN];
    const [cos, sin] = [Math.cos(poses[2]!), Math.sin(poses[2]!)];
    place = [poses[0]! + along * cos - across * sin, poses[1]! + along * sin + across * cos];
    CONTACT.set(recording, place);
  }
  return place;
}

export function drawContact(scene: Scene): void {
  if (!scene.original) return;
  const { ctx, ink } = scene;
  const [x, y] = contactOf(scene);
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
