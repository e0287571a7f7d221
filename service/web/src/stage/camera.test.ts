import { describe, expect, it } from "vitest";
import { fitted, following, groundX, groundY, panned, projectX, projectY, SCALES, Tripod, zoomed, type Camera } from "./camera";

const VIEW = { width: 800, height: 400 };
const CAMERA: Camera = { x: 100, y: -50, scale: 8 };

describe("projection", () => {
  it("puts the camera's place in the middle, and north up", () => {
    expect([projectX(CAMERA, VIEW, 100), projectY(CAMERA, VIEW, -50)]).toEqual([400, 200]);
    expect([projectX(CAMERA, VIEW, 110), projectY(CAMERA, VIEW, -40)]).toEqual([480, 120]);
  });
  it("comes back", () => {
    expect(groundX(CAMERA, VIEW, projectX(CAMERA, VIEW, 3.7))).toBeCloseTo(3.7);
    expect(groundY(CAMERA, VIEW, projectY(CAMERA, VIEW, -8.1))).toBeCloseTo(-8.1);
  });
});

it("zoomed keeps the ground under the pointer", () => {
  for (const factor of [0.5, 1.25, 3]) {
    const camera = zoomed(CAMERA, VIEW, factor, 123, 321);
    expect(camera.scale).toBeCloseTo(8 * factor);
    expect(groundX(camera, VIEW, 123)).toBeCloseTo(groundX(CAMERA, VIEW, 123));
    expect(groundY(camera, VIEW, 321)).toBeCloseTo(groundY(CAMERA, VIEW, 321));
  }
  expect(zoomed(CAMERA, VIEW, 1e9, 0, 0).scale).toBe(SCALES.most);
  expect(zoomed(CAMERA, VIEW, 1e-9, 0, 0).scale).toBe(SCALES.least);
});

it("panned moves the ground with the pointer", () => {
  const camera = panned(CAMERA, 16, -8);
  expect(groundX(camera, VIEW, 216)).toBeCloseTo(groundX(CAMERA, VIEW, 200));
  expect(groundY(camera, VIEW, 92)).toBeCloseTo(groundY(CAMERA, VIEW, 100));
});

it("fitted has all of the bounds and the margin in view", () => {
  const camera = fitted({ left: 0, right: 60, bottom: 0, top: 10 }, VIEW, 10);
  expect(camera).toEqual({ x: 30, y: 5, scale: 10 });
  expect(fitted({ left: 0, right: 0, bottom: 0, top: 20 }, VIEW, 10).scale).toBe(10);
});

it("following leaves more room ahead than behind", () => {
  const ego = { x: 5, y: 7, heading: Math.PI / 2 };
  const camera = following(CAMERA, VIEW, ego);
  expect(projectX(camera, VIEW, 5)).toBeCloseTo(400);
  expect(projectY(camera, VIEW, 7)).toBeCloseTo(264);
});

describe("Tripod", () => {
  const begun = () => {
    const tripod = new Tripod({ left: 0, right: 60, bottom: 0, top: 10 });
    tripod.measured(VIEW);
    return tripod;
  };
  const ego = { x: 500, y: 0, heading: 0 };
  it("follows from the beginning, at the scale that fits", () => {
    expect(begun().at(VIEW, ego)).toEqual({ x: 506.4, y: 0, scale: 10 });
  });
  it("stays where it was when it lets go", () => {
    const tripod = begun();
    tripod.at(VIEW, ego);
    tripod.pan(10, 0);
    expect(tripod.follow.get()).toBe(false);
    expect(tripod.at(VIEW, ego).x).toBeCloseTo(505.4);
  });
  it("keeps the scale that somebody chose when the window changes", () => {
    const tripod = begun();
    tripod.zoom(2);
    tripod.measured({ width: 300, height: 300 });
    expect(tripod.camera.get().scale).toBe(20);
  });
  it("looks on from where it is when nobody is there to follow", () => {
    const tripod = begun();
    expect(tripod.at(VIEW, { x: Number.NaN, y: 0, heading: 0 }).x).toBe(30);
  });
});
