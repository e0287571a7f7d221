import { expect, test } from "vitest";
import { colourOf, counted, laidOver } from "./density";

const stack = { width: 20, axes: 3, pitch: 4 };

test("a line straight down is one pixel wide, from the first axis to the last", () => {
  const counts = counted([0], stack, () => 5);
  for (let y = 0; y < 12; y++) {
    const row = [...counts.slice(y * 20, y * 20 + 20)];
    expect(row.reduce((sum, each) => sum + each, 0)).toBe(y >= 2 && y < 10 ? 1 : 0);
    expect(row[5]).toBe(y >= 2 && y < 10 ? 1 : 0);
  }
});

test("a slanted line leaves no gap, and its mirror image is as wide", () => {
  const there = counted([0], stack, (_, axis) => [2, 14, 2][axis]!);
  for (let y = 2; y < 6; y++) {
    const x = [...there.slice(y * 20, y * 20 + 20).keys()].filter((at) => there[y * 20 + at]);
    expect(x[0]).toBe(2 + 3 * (y - 2));
    expect(x.at(-1)).toBe(5 + 3 * (y - 2));
    expect([...there.slice((11 - y) * 20, (12 - y) * 20)]).toEqual([...there.slice(y * 20, y * 20 + 20)]);
  }
});

test("lines add up, and one without a value at an axis is broken there", () => {
  const counts = counted([0, 1], stack, (line, axis) => (line === 1 && axis === 2 ? NaN : 5));
  expect(counts[3 * 20 + 5]).toBe(2);
  expect(counts[7 * 20 + 5]).toBe(1);
});

test("what lies outside the picture is not drawn elsewhere", () => {
  expect(counted([0], stack, () => 25).every((each) => each === 0)).toBe(true);
  expect(counted([0], stack, () => -3).every((each) => each === 0)).toBe(true);
});

test("more lines cover more, and none cover nothing", () => {
  const pixels = new Uint8ClampedArray(12);
  laidOver(pixels, Uint16Array.from([0, 1, 100]), [255, 0, 0], { least: 0.2, most: 1, highest: 100 });
  expect(pixels[3]).toBe(0);
  expect([...pixels.slice(4, 8)]).toEqual([255, 0, 0, 51]);
  expect(pixels[11]).toBeGreaterThan(240);
});

test("a colour over another one mixes", () => {
  const pixels = Uint8ClampedArray.from([0, 0, 255, 255]);
  laidOver(pixels, Uint16Array.from([1]), colourOf("#ff0000"), { least: 0.5, most: 1, highest: 1 });
  expect([...pixels]).toEqual([128, 0, 128, 255]);
});
