/** Colours of the methods: those of the report's figures, as variables of the style sheet. */

import palette from "../../../../risk_sac/report/palette.json";

export type MethodColour = `--method-${keyof typeof palette}`;

/** Method -> the name of its colour, and its dashes in matplotlib's notation. */
export const METHODS: Record<string, { colour: MethodColour; dashes: string }> = Object.fromEntries(
  Object.entries(palette).map(([method, { dashes }]) => [method, { colour: nameOf(method), dashes }]),
);
export const METHOD_COLOURS = Object.keys(palette).map(nameOf);

/** Makes the variables known to the document, for both themes. */
export function definePalette(): void {
  const each = (colourOf: (light: string) => string) =>
    Object.entries(palette).map(([method, { colour }]) => `${nameOf(method)}: ${colourOf(colour)};`).join(" ");
  const sheet = new CSSStyleSheet();
  sheet.replaceSync(`:root { ${each((light) => light)} } :root[data-theme="dark"] { ${each(onDark)} }`);
  document.adoptedStyleSheets = [...document.adoptedStyleSheets, sheet];
}

/** A colour as `invert(1) hue-rotate(180deg)` shows it, which figures get in the dark theme: its lightness reversed. */
export function onDark(light: string): string {
  const parts = [1, 3, 5].map((at) => parseInt(light.slice(at, at + 2), 16));
  const brightness = 0.213 * parts[0]! + 0.715 * parts[1]! + 0.072 * parts[2]!;
  const turned = parts.map((part) => Math.round(Math.min(255, Math.max(0, part + 255 - 2 * brightness))));
  return `#${turned.map((part) => part.toString(16).padStart(2, "0")).join("")}`;
}

function nameOf(method: string): MethodColour {
  return `--method-${method}` as MethodColour;
}
