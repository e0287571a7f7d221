import { expect, it } from "vitest";
import type { Recording } from "../../stage/recording";
import { between, commonTimes, sensorOf } from "./twins";

it("a twin's later frames follow those that both have", () => {
  expect([...commonTimes([-0.2, -0.1, 0], [-0.2000001, -0.1, 0.00001, 0.1])].map((time) => Number(time.toFixed(3)))).toEqual([-0.2, -0.1, 0, 0.1]);
  expect([...commonTimes([-0.1, 0], null)]).toEqual([-0.1, 0]);
});

it("a camera for both looks at the middle between the egos, and at one where the other is absent", () => {
  const ego = (x: number) => ({ actors: 1, time_s: [0, 1], x_m: [x, x + 2], y_m: [0, 0], heading_rad: [0, 0] }) as unknown as Recording;
  expect(between([ego(0), ego(10)])(0.5)).toEqual({ x: 6, y: 0, heading: 0 });
  expect(between([ego(4), ego(Number.NaN)])(0)).toEqual({ x: 4, y: 0, heading: 0 });
});

it("a perfect ego has no sensor, and nobody else's attack changes the ego's own", () => {
  const own = { range_m: 30, field_of_view_rad: 1, occlusion: false };
  expect(sensorOf("perfect", own)).toBeNull();
  expect(sensorOf("idle", own)).toBe(own);
  expect(sensorOf("careful", own)?.range_m).toBe(80);
});
