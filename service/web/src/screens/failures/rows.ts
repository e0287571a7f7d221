/** Which rows of a long grid are in view: only they are in the document. */

export interface Grid {
  /** How many cards. */
  size: number;
  columns: number;
  /** Of a card, and the gap between two, px. */
  height: number;
  gap: number;
}

export interface Rows {
  /** From the first card to be drawn to behind the last. */
  from: number;
  to: number;
  /** Height of all rows. */
  whole: number;
}

/** How many columns fit. All in px: width of the grid, least width of a card, gap between two. */
export function columnsOf({ width, least, gap }: { width: number; least: number; gap: number }): number {
  return Math.max(1, Math.floor((width + gap) / (least + gap)));
}

/** @param top how far the view's upper edge lies below the grid's; negative where the grid begins lower.
 *  @param spare rows drawn above and below the view, so that the keyboard finds the next one. */
export function rowsInView(grid: Grid, top: number, viewHeight: number, spare = 2): Rows {
  const { columns } = grid;
  const rows = Math.ceil(grid.size / columns);
  const pitch = grid.height + grid.gap;
  const first = Math.min(rows, Math.max(0, Math.floor(top / pitch) - spare));
  const behind = Math.min(rows, Math.max(0, Math.ceil((top + viewHeight) / pitch) + spare));
  return {
    from: first * columns,
    to: Math.min(grid.size, behind * columns),
    whole: rows ? rows * pitch - grid.gap : 0,
  };
}

/** Where the keyboard goes from a card; null for keys that do not move. */
export function moved(key: string, at: number, columns: number, size: number): number | null {
  const steps = new Map([["ArrowLeft", -1], ["ArrowRight", 1], ["ArrowUp", -columns], ["ArrowDown", columns]]);
  if (key === "Home") return 0;
  if (key === "End") return size - 1;
  const step = steps.get(key);
  if (step === undefined) return null;
  const to = at + step;
  return to >= 0 && to < size ? to : at;
}
