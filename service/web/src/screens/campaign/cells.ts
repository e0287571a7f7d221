/** The cells of two scene parameters, out of the pairs of the API, in which each two stand once. */

import type { Body } from "../../api/types";

export interface Cell {
  played: number;
  failed: number;
}

/** By the bins of `rows`, then of `columns`; null where both are the same parameter. */
export function cellsOf({ pairs }: Pick<Body<"FamilySceneEffects">, "pairs">, rows: string, columns: string): Cell[][] | null {
  for (const { parameters, played, failed } of pairs) {
    const cells = played.map((row, i) => row.map((all, j) => ({ played: all, failed: failed[i]![j]! })));
    if (parameters[0] === rows && parameters[1] === columns) return cells;
    if (parameters[0] === columns && parameters[1] === rows) return turned(cells);
  }
  return null;
}

function turned(cells: Cell[][]): Cell[][] {
  return cells[0]!.map((_, j) => cells.map((row) => row[j]!));
}
