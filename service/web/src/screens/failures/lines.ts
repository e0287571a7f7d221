/** How parallel coordinates are drawn: axes lie below each other, so that their names can be read. */

import type { Brushes } from "./brushes";
import type { Size } from "./canvas";
import { colourOf, counted, highestOf, laidOver, MANY } from "./density";
import type { Feature } from "./features";
import { tickText, type Scale } from "./scale";
import type { Grade } from "./wire";

export interface Lines {
  features: readonly Feature[];
  scales: readonly Scale[];
  pitch: number;
  grades: readonly (Grade | null)[];
}

interface Pen {
  colour: string;
  width: number;
}

export interface Ink {
  hidden: Pen;
  grades: Record<Grade | "none", Pen>;
  axis: string;
  text: string;
  ground: string;
  brush: string;
}

const ORDER: readonly (Grade | null)[] = [null, "unavoidable", "full_braking", "preventable"]; // what matters most lies on top
const COVER = { least: 0.05, most: 0.85 };

/** Lines of failures, each grade with a pen of its own; the more lines, the fainter. */
export function drawLines(context: CanvasRenderingContext2D, lines: Lines, size: Size, failures: readonly number[], penOf: (grade: Grade | null) => Pen): void {
  if (failures.length < MANY) stroked(context, lines, failures, penOf);
  else painted(context, lines, size, failures, penOf);
}

function stroked(context: CanvasRenderingContext2D, lines: Lines, failures: readonly number[], penOf: (grade: Grade | null) => Pen): void {
  for (const grade of ORDER) {
    const some = failures.filter((i) => lines.grades[i] === grade);
    const { colour, width } = penOf(grade);
    context.strokeStyle = colour;
    context.lineWidth = width;
    context.globalAlpha = Math.max(0.15, Math.min(0.85, 9 / Math.sqrt(some.length + 1)));
    for (const i of some) {
      context.beginPath();
      strokeLine(context, lines, i);
      context.stroke();
    }
  }
  context.globalAlpha = 1;
}

/** The same as a picture that is reckoned pixel by pixel. */
function painted(context: CanvasRenderingContext2D, { features, scales, pitch, grades }: Lines, { width }: Size, failures: readonly number[], penOf: (grade: Grade | null) => Pen): void {
  const stack = { width, pitch, axes: features.length };
  const picture = new ImageData(width, features.length * pitch);
  const layers = ORDER.map((grade) => {
    const some = failures.filter((i) => grades[i] === grade);
    return { grade, counts: counted(some, stack, (i, axis) => scales[axis]!.at(features[axis]!.values[i]!)) };
  });
  const highest = Math.max(...layers.map(({ counts }) => highestOf(counts))); // a few of one grade stay fainter than many of another
  for (const { grade, counts } of layers) laidOver(picture.data, counts, colourOf(penOf(grade).colour), { ...COVER, highest });
  const canvas = Object.assign(document.createElement("canvas"), { width: picture.width, height: picture.height });
  canvas.getContext("2d")!.putImageData(picture, 0, 0);
  context.drawImage(canvas, 0, 0, picture.width, picture.height);
}

/** Adds one failure's line to the path; it is broken where there is no value. */
export function strokeLine(context: CanvasRenderingContext2D, { features, scales, pitch }: Lines, failure: number): void {
  let on = false;
  for (let axis = 0; axis < features.length; axis++) {
    const x = scales[axis]!.at(features[axis]!.values[failure]!);
    const y = (axis + 0.5) * pitch;
    if (x !== x) on = false;
    else if (on) context.lineTo(x, y);
    else {
      context.moveTo(x, y);
      on = true;
    }
  }
}

/** The axes with both their ends, and the brushes on them. */
export function drawAxes(context: CanvasRenderingContext2D, { features, scales, pitch }: Lines, { width }: Size, brushes: Brushes, ink: Ink): void {
  context.font = "10px system-ui, sans-serif";
  features.forEach(({ key }, axis) => {
    const [scale, y] = [scales[axis]!, Math.round((axis + 0.5) * pitch) + 0.5];
    context.strokeStyle = ink.axis;
    context.lineWidth = 1;
    context.beginPath();
    for (const end of [scale.at(scale.low), scale.at(scale.high)]) {
      context.moveTo(end, y - 3);
      context.lineTo(end, y + 3);
    }
    context.moveTo(scale.at(scale.low), y);
    context.lineTo(scale.at(scale.high), y);
    context.stroke();
    const brush = brushes.get(key);
    const [low, high] = brush ? [Math.max(brush[0], scale.low), Math.min(brush[1], scale.high)] : [scale.low, scale.high];
    if (brush && low <= high) {
      context.fillStyle = ink.brush;
      context.globalAlpha = 0.25;
      context.fillRect(scale.at(low), y - 7, Math.max(2, scale.at(high) - scale.at(low)), 14);
      context.globalAlpha = 1;
      context.fillRect(scale.at(low) - 1, y - 8, 2, 16);
      context.fillRect(scale.at(high) - 1, y - 8, 2, 16);
    }
    const style = brush ? ink.text : ink.axis;
    const room = scale.at(high) - scale.at(low) > 60;
    label(context, tickText(low, scale.low, scale.high, 40), room ? scale.at(low) : Math.max(2, scale.at(low) - 34), y + 12, "left", style, ink.ground);
    label(context, tickText(high, scale.low, scale.high, 40), room ? scale.at(high) : Math.min(width - 2, scale.at(high) + 34), y + 12, "right", style, ink.ground);
  });
}

/** Text that can be read on top of lines. */
function label(context: CanvasRenderingContext2D, text: string, x: number, y: number, align: CanvasTextAlign, colour: string, ground: string): void {
  context.textAlign = align;
  context.lineWidth = 3;
  context.lineJoin = "round";
  context.strokeStyle = ground;
  context.strokeText(text, x, y);
  context.fillStyle = colour;
  context.fillText(text, x, y);
}
