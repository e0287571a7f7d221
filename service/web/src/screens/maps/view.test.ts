import { expect, it } from "vitest";
import { apartOf, hit, isLong, marksOf, panned, pixelX, pixelY, showing, whole, zoomed } from "./view";

const SIZE = { width: 848, height: 448 };
const TOWN = { left: 0, right: 1000, bottom: -100, top: 400 };
const MOTORWAY = { left: 0, right: 8000, bottom: -6, top: 6 };

it("shows all of a town on equal axes", () => {
  const view = whole(TOWN, SIZE, isLong(TOWN));
  expect(view).toEqual({ x: 500, y: 150, scaleX: 0.8, scaleY: 0.8 });
  expect([pixelX(view, SIZE, 0), pixelX(view, SIZE, 1000), pixelY(view, SIZE, 400)]).toEqual([24, 824, 24]);
});

it("scales the axes of a motorway apart, within bounds, and only if it may", () => {
  const view = whole(MOTORWAY, SIZE, isLong(MOTORWAY));
  expect(view.scaleX).toBe(0.1);
  expect(apartOf(view)).toEqual({ times: 40, axis: "y" });
  expect(apartOf(whole(MOTORWAY, SIZE, false)).times).toBe(1);
  const northward = { left: -6, right: 6, bottom: 0, top: 8000 };
  expect(apartOf(whole(northward, SIZE, true))).toEqual({ times: 40, axis: "x" });
});

it("zooms around a pixel and drags the ground along", () => {
  const view = zoomed(whole(MOTORWAY, SIZE, true), SIZE, 2, 200, 300);
  const before = whole(MOTORWAY, SIZE, true);
  const [x, y] = [before.x + (200 - 424) / before.scaleX, before.y - (300 - 224) / before.scaleY];
  expect(pixelX(view, SIZE, x)).toBeCloseTo(200);
  expect(pixelY(view, SIZE, y)).toBeCloseTo(300);
  expect(pixelX(panned(view, 10, -5), SIZE, x)).toBeCloseTo(210);
  expect(pixelY(panned(view, 10, -5), SIZE, y)).toBeCloseTo(295);
  expect(zoomed(view, SIZE, 1e9, 0, 0).scaleX).toBe(40);
});

it("moves to a point only if it is out of sight", () => {
  const near = zoomed(whole(TOWN, SIZE, false), SIZE, 4, 424, 224);
  expect(showing(near, SIZE, { x_m: 510, y_m: 150 })).toBe(near);
  expect(showing(near, SIZE, { x_m: 0, y_m: 0 })).toMatchObject({ x: 0, y: 0, scaleX: near.scaleX });
});

it("draws the marks of one place beside each other, and finds the nearest one", () => {
  const view = whole(TOWN, SIZE, false);
  const points = [{ x_m: 0, y_m: 0 }, { x_m: 500, y_m: 150 }, { x_m: 500, y_m: 150 }];
  const marks = marksOf(points);
  expect(marks.map(({ aside }) => aside)).toEqual([0, -6.5, 6.5]);
  expect(hit(marks, view, SIZE, { px: 416, py: 224 }, 12)).toBe(points[1]);
  expect(hit(marks, view, SIZE, { px: 432, py: 220 }, 12)).toBe(points[2]);
  expect(hit(marks, view, SIZE, { px: 700, py: 20 }, 12)).toBeUndefined();
});
