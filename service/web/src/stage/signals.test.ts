import { expect, test } from "vitest";
import { lampAt } from "./signals";

test("a signal shows the colour that began last before a frame", () => {
  const changes: [number, "red" | "green" | "yellow"][] = [[-5, "red"], [2, "green"], [7.5, "yellow"]];
  expect([0, 2, 2.1, 7.5, 7.6, 100].map((time) => lampAt({ changes }, time))).toEqual(["red", "red", "green", "green", "yellow", "yellow"]);
  expect(lampAt({ changes }, -9)).toBe("red");
});
