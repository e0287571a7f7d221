/** The colours that stages and plots are drawn with, by their names in the style sheet. */

import type { Part } from "./recording";

export const NAMES = [
  "--ground",
  "--surface",
  "--text",
  "--faint",
  "--line",
  "--grid",
  "--shade",
  "--road",
  "--sidewalk",
  "--crossing",
  "--ego",
  "--striker",
  "--adversary",
  "--background-car",
  "--good",
  "--bad",
  "--warn",
  "--series-1",
  "--series-2",
  "--series-3",
  "--series-4",
  "--series-5",
  "--series-6",
] as const;

export type Colour = (typeof NAMES)[number];
export type Ink = Record<Colour, string>;

export const PART_COLOURS: Record<Part, Colour> = {
  ego: "--ego",
  striker: "--striker",
  adversary: "--adversary",
  background: "--background-car",
};
