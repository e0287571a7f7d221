/** Marks of the grades: a shape and a colour each, so that either tells them apart. */

import type { GradeName } from "../../ui/verdicts";

type Outline = (context: CanvasRenderingContext2D | Path2D, r: number) => void;

export const OUTLINES: Record<GradeName, Outline> = {
  preventable: (c, r) => c.arc(0, 0, r, 0, 2 * Math.PI),
  full_braking: (c, r) => {
    const reach = r * 1.25;
    c.moveTo(0, -reach);
    c.lineTo(reach, 0);
    c.lineTo(0, reach);
    c.lineTo(-reach, 0);
    c.closePath();
  },
  unavoidable: (c, r) => c.rect(-r * 0.85, -r * 0.85, r * 1.7, r * 1.7),
  none: (c, r) => {
    c.moveTo(-r, -r);
    c.lineTo(r, r);
    c.moveTo(r, -r);
    c.lineTo(-r, r);
  },
};

/** Only what a person should look at is filled. */
export const FILLED: Record<GradeName, boolean> = { preventable: true, full_braking: true, unavoidable: false, none: false };

/** The mark as a picture of its own: thousands of stamps are drawn in the time of a hundred outlines. */
export function stamp(grade: GradeName, colour: string, ground: string, r: number, ratio: number): HTMLCanvasElement {
  const side = Math.ceil((2 * r * 1.25 + 4) * ratio);
  const canvas = Object.assign(document.createElement("canvas"), { width: side, height: side });
  const context = canvas.getContext("2d")!;
  context.translate(side / 2, side / 2);
  context.scale(ratio, ratio);
  context.beginPath();
  OUTLINES[grade](context, r);
  context.lineWidth = FILLED[grade] ? 1 : 1.5;
  context.fillStyle = colour;
  context.strokeStyle = FILLED[grade] ? ground : colour; // a thin gap parts marks that lie on each other
  if (FILLED[grade]) context.fill();
  context.stroke();
  return canvas;
}

/** The same outlines as the data of an SVG path, around (8, 8) of a 16 px square: for legends and cards. */
export const PATHS: Record<GradeName, string> = {
  preventable: "M3 8a5 5 0 1 0 10 0a5 5 0 1 0 -10 0z",
  full_braking: "M8 1.8L14.2 8L8 14.2L1.8 8z",
  unavoidable: "M3.6 3.6h8.8v8.8h-8.8z",
  none: "M4 4L12 12M12 4L4 12",
};
