import { expect, test } from "vitest";
import { columnsOf, moved, rowsInView } from "./rows";

const grid = { size: 10_000, columns: 3, height: 280, gap: 20 };

test("as many columns as fit, gaps between them", () => {
  expect(columnsOf({ width: 850, least: 260, gap: 20 })).toBe(3);
  expect(columnsOf({ width: 819, least: 260, gap: 20 })).toBe(2);
  expect(columnsOf({ width: 100, least: 260, gap: 20 })).toBe(1);
});

test("only rows near the view are drawn, and every row in view is", () => {
  const [pitch, view] = [300, 720];
  for (const top of [-500, 0, 1, 299, 300, 12_345, 1_000_000]) {
    const { columns } = grid;
    const { from, to, whole } = rowsInView(grid, top, view);
    expect(to - from).toBeLessThanOrEqual(columns * (Math.ceil(view / pitch) + 5));
    const rows = Math.ceil(grid.size / columns);
    for (let row = 0; row < rows; row++) {
      const inView = row * pitch < top + view && row * pitch + grid.height > top;
      if (inView) expect(from <= row * columns && to >= Math.min(grid.size, (row + 1) * columns)).toBe(true);
    }
    expect(whole).toBe(rows * pitch - 20);
  }
});

test("an empty grid is empty", () => {
  expect(rowsInView({ ...grid, size: 0 }, 0, 600)).toMatchObject({ from: 0, to: 0, whole: 0 });
});

test("keys move by cards and rows, and stay inside", () => {
  expect(moved("ArrowRight", 4, 3, 10)).toBe(5);
  expect(moved("ArrowDown", 4, 3, 10)).toBe(7);
  expect(moved("ArrowDown", 8, 3, 10)).toBe(8);
  expect(moved("ArrowUp", 1, 3, 10)).toBe(1);
  expect(moved("Home", 5, 3, 10)).toBe(0);
  expect(moved("End", 5, 3, 10)).toBe(9);
  expect(moved("Tab", 5, 3, 10)).toBe(null);
  expect(moved("constructor", 5, 3, 10)).toBe(null);
});
