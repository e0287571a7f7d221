/** The ground: surfaces as paths in metres, made once and filled in each picture. */

import type { Body } from "../api/types";
import { pixelX, pixelY, type Scene } from "./scene";

type Roads = Body<"RoadsBody">;
type Surface = Body<"SurfaceBody">;

interface Zebra {
  along: Path2D;
  width_m: number;
}

export interface RoadPaths {
  sidewalks: Path2D;
  lanes: Path2D;
  junctions: Path2D;
  crossings: Path2D;
  zebras: Zebra[];
  signals: Roads["signals"];
}

const STRIPE_M = 0.5;

export function roadPaths({ surfaces, signals }: Roads): RoadPaths {
  const all = (use: Surface["use"]) => {
    const path = new Path2D();
    for (const surface of surfaces) if (surface.use === use) addRing(path, surface.outline);
    return path;
  };
  return {
    sidewalks: all("sidewalk"),
    lanes: all("lane"),
    junctions: all("junction"),
    crossings: all("crossing"),
    zebras: surfaces.filter(({ use, outline }) => use === "crossing" && outline.length >= 4).map(zebra),
    signals,
  };
}

/** Fills the whole view: ground, then surfaces from below. */
export function drawGround(scene: Scene): void {
  const { ctx, view, ink, roads, camera, density } = scene;
  ctx.fillStyle = ink["--ground"];
  ctx.fillRect(0, 0, view.width, view.height);
  if (roads === null) return;
  ctx.save();
  const scale = camera.scale * density;
  ctx.setTransform(scale, 0, 0, -scale, pixelX(scene, 0) * density, pixelY(scene, 0) * density);
  ctx.fillStyle = ink["--sidewalk"];
  ctx.fill(roads.sidewalks);
  ctx.fillStyle = ink["--road"];
  ctx.fill(roads.junctions);
  ctx.fill(roads.lanes);
  ctx.strokeStyle = ink["--crossing"];
  ctx.lineWidth = 1.2 / camera.scale;
  ctx.stroke(roads.sidewalks);
  ctx.stroke(roads.lanes);
  ctx.fillStyle = ink["--road"];
  ctx.fill(roads.crossings);
  ctx.strokeStyle = ink["--crossing"];
  ctx.setLineDash([STRIPE_M, STRIPE_M]);
  for (const { along, width_m } of roads.zebras) {
    ctx.lineWidth = width_m;
    ctx.stroke(along);
  }
  ctx.restore();
}

function addRing(path: Path2D, outline: number[][]): void {
  outline.forEach(([x, y], k) => (k === 0 ? path.moveTo(x!, y!) : path.lineTo(x!, y!)));
  path.closePath();
}

/** A crossing's outline goes along its left side and back along its right one; between them lies its middle line. */
function zebra({ outline }: Surface): Zebra {
  const along = new Path2D();
  const half = Math.floor(outline.length / 2);
  for (let k = 0; k < half; k++) {
    const [leftX, leftY] = outline[k]!;
    const [rightX, rightY] = outline[outline.length - 1 - k]!;
    const x = (leftX! + rightX!) / 2;
    const y = (leftY! + rightY!) / 2;
    if (k === 0) along.moveTo(x, y);
    else along.lineTo(x, y);
  }
  const [first, last] = [outline[0]!, outline.at(-1)!];
  return { along, width_m: Math.hypot(first[0]! - last[0]!, first[1]! - last[1]!) };
}
