/** Cells of a coverage matrix: what each state is called, and which rows a filter leaves. Pure. */

import type { Body } from "../../api/types";

export type Matrix = Body<"CoverageMatrix">;
export type Group = Body<"CoverageGroup">;
export type Row = Body<"CoverageRow">;
export type Cell = Body<"CoverageCell">;
export type State = Body<"CellState">;

/** State → what it is called, and its sign. */
export const STATES: Record<State, [name: string, sign: string]> = {
  failed: ["failed", "✕"],
  played: ["played, no failure", "✓"],
  never: ["never played", "–"],
  inexpressible: ["not expressible", "∅"],
};
export const ORDER = Object.keys(STATES) as State[];

/** The rows of a group with a cell in one of the states, and of each row these cells alone; no state: all. */
export function filtered(group: Group, state: State | undefined): Row[] {
  if (!state) return group.rows;
  return group.rows.map((row) => ({ ...row, cells: row.cells.filter((cell) => cell.state === state) })).filter((row) => row.cells.length > 0);
}

/** `3 of 40 failed`, as a chip has it: what the state alone does not tell. */
export function numbersOf({ state, played, failed }: Cell): string {
  if (state === "failed") return `${failed.toLocaleString("en")} of ${played.toLocaleString("en")}`;
  return state === "played" ? played.toLocaleString("en") : "";
}
