import { expect, it } from "vitest";
import { cellsOf } from "./cells";

const FAMILY = { pairs: [{ parameters: ["gap", "speed"] as [string, string], played: [[1, 2, 3], [4, 5, 6]], failed: [[0, 1, 0], [0, 0, 2]] }] };

it("cells stand by rows, then columns, whichever way round they are asked for", () => {
  expect(cellsOf(FAMILY, "gap", "speed")![1]![2]).toEqual({ played: 6, failed: 2 });
  expect(cellsOf(FAMILY, "speed", "gap")![2]![1]).toEqual({ played: 6, failed: 2 });
  expect(cellsOf(FAMILY, "speed", "gap")).toHaveLength(3);
});

it("a parameter has no cells with itself", () => expect(cellsOf(FAMILY, "gap", "gap")).toBeNull());
