/** Oriented boxes on the plane: corners, what a body hides, and where a line of sight meets it. */

/** Corners, counter-clockwise from the front left: x, y of each in turn. */
export function corners(x: number, y: number, heading: number, length: number, width: number, into: Float64Array): void {
  const cos = Math.cos(heading);
  const sin = Math.sin(heading);
  for (let k = 0; k < 4; k++) {
    const along = (k === 0 || k === 3 ? length : -length) / 2;
    const across = (k < 2 ? width : -width) / 2;
    into[2 * k] = x + along * cos - across * sin;
    into[2 * k + 1] = y + along * sin + across * cos;
  }
}

/**
 * What a body hides from an eye: the quadrilateral behind it, from its two outermost corners to `reach` beyond.
 *
 * @param body corners, as `corners` gives them.
 * @param into four points, x and y each: right corner, its end, the left one's end, left corner; counter-clockwise.
 * @returns false if the eye is inside of the body's bounds, so that there is no behind.
 */
export function shadow(eyeX: number, eyeY: number, body: Float64Array, reach: number, into: Float64Array): boolean {
  const middleX = (body[0]! + body[4]!) / 2 - eyeX;
  const middleY = (body[1]! + body[5]!) / 2 - eyeY;
  let left = -1;
  let right = -1;
  let most = 0;
  let least = 0;
  for (let k = 0; k < 4; k++) {
    const x = body[2 * k]! - eyeX;
    const y = body[2 * k + 1]! - eyeY;
    if (x * middleX + y * middleY <= 0) return false; // a corner beside or behind the eye: they touch, or nearly
    const angle = Math.atan2(middleX * y - middleY * x, middleX * x + middleY * y);
    if (left < 0 || angle > most) [left, most] = [k, angle];
    if (right < 0 || angle < least) [right, least] = [k, angle];
  }
  place(eyeX, eyeY, body, right, reach, into, 0, 2);
  place(eyeX, eyeY, body, left, reach, into, 6, 4);
  return true;
}

function place(eyeX: number, eyeY: number, body: Float64Array, corner: number, reach: number, into: Float64Array, near: number, far: number): void {
  const x = body[2 * corner]!;
  const y = body[2 * corner + 1]!;
  const longer = Math.max(reach / Math.hypot(x - eyeX, y - eyeY), 1);
  into[near] = x;
  into[near + 1] = y;
  into[far] = eyeX + (x - eyeX) * longer;
  into[far + 1] = eyeY + (y - eyeY) * longer;
}

/**
 * Where the way from an eye to a point enters a body, as a share of the way; 1 if it does not.
 *
 * The slab test in the body's own axes, as `risk_sac.world.geometry` has it.
 */
export function entry(eyeX: number, eyeY: number, toX: number, toY: number, x: number, y: number, heading: number, length: number, width: number): number {
  const cos = Math.cos(heading);
  const sin = Math.sin(heading);
  const alongEye = (eyeX - x) * cos + (eyeY - y) * sin;
  const acrossEye = (eyeY - y) * cos - (eyeX - x) * sin;
  const along = (toX - eyeX) * cos + (toY - eyeY) * sin || 1e-9;
  const across = (toY - eyeY) * cos - (toX - eyeX) * sin || 1e-9;
  const enter = Math.max(-alongEye / along - length / 2 / Math.abs(along), -acrossEye / across - width / 2 / Math.abs(across));
  const leave = Math.min(-alongEye / along + length / 2 / Math.abs(along), -acrossEye / across + width / 2 / Math.abs(across));
  return enter < leave && enter < 1 && enter > 0 ? enter : 1;
}

export interface Bounds {
  left: number;
  right: number;
  bottom: number;
  top: number;
}

/** The least box around some points, given as x and y in turn; null without any. Points that are NaN are left out. */
export function boundsOf(points: Iterable<readonly [number, number]>): Bounds | null {
  let bounds: Bounds | null = null;
  for (const [x, y] of points) {
    if (Number.isNaN(x) || Number.isNaN(y)) continue;
    bounds ??= { left: x, right: x, bottom: y, top: y };
    bounds.left = Math.min(bounds.left, x);
    bounds.right = Math.max(bounds.right, x);
    bounds.bottom = Math.min(bounds.bottom, y);
    bounds.top = Math.max(bounds.top, y);
  }
  return bounds;
}

/** A length of 1, 2 or 5 times a power of ten: the largest that is no longer than `most`. */
export function roundLength(most: number): number {
  const power = 10 ** Math.floor(Math.log10(most));
  return (most >= 5 * power ? 5 : most >= 2 * power ? 2 : 1) * power;
}
