import { expect, test } from "vitest";
import { METHODS, METHOD_COLOURS, onDark } from "./palette";

test("a dark theme reverses lightness and keeps hues", () => {
  expect(onDark("#000000")).toBe("#ffffff");
  expect(onDark("#777777")).toBe("#888888");
  expect(onDark("#cc6677")).toBe("#d16b7c");
});

test("each method has a colour of its own", () => {
  expect(new Set(METHOD_COLOURS).size).toBe(Object.keys(METHODS).length);
  expect(METHODS["risk-sac"]).toEqual({ colour: "--method-risk-sac", dashes: "-" });
});
