/** Where the service says that a formula is wrong. */

export interface Fault {
  /** 0-based, in characters; null where the whole formula is meant. */
  column: number | null;
  why: string;
}

/** `requirement 'a': column 16: '=' is not supported` -> 16 and what follows. */
export function faultOf(message: string): Fault {
  const [, column, why] = /(?:^|: )column (\d+): ([\s\S]*)$/.exec(message) ?? [];
  return column === undefined ? { column: null, why: message } : { column: Number(column), why: why! };
}

/** The formula with a caret under the column, as a compiler shows it. */
export function pointed(formula: string, column: number): string {
  const characters = [...formula.replaceAll(/\s/g, " ")]; // a tab is as wide as the browser likes
  const before = Math.min(column, characters.length);
  return `${characters.join("")}\n${" ".repeat(before)}^`;
}

/** A text with a word put where the cursor is, and where the cursor is then. */
export function inserted(text: string, word: string, start: number, end: number): [text: string, cursor: number] {
  const gap = start > 0 && !/[\s(]$/.test(text.slice(0, start)) ? " " : "";
  return [text.slice(0, start) + gap + word + text.slice(end), start + gap.length + word.length];
}
