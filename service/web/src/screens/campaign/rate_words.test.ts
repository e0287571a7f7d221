import { expect, test } from "vitest";
import { shared, small, within } from "./rate_words";

test("rates have three digits, rare ones as a power of ten", () => {
  expect(small(0.01784)).toBe("0.0178");
  expect(small(0.000097)).toBe("9.70 × 10⁻⁵");
  expect(small(3.2e-12)).toBe("3.20 × 10⁻¹²");
  expect(small(0)).toBe("0");
  expect(small(214.2)).toBe("214");
});

test("an interval without ends is a dash", () => {
  expect(within({ low: 0.015, high: 0.0211 })).toBe("0.015 to 0.0211");
  expect(within({ low: null, high: null })).toBe("–");
});

test("only declared distributions are named, with their source", () => {
  const uniform = { kind: "uniform", source: "" };
  expect(shared({ gap_m: uniform })).toBe("uniform over all parameters, a choice.");
  expect(shared({ gap_m: uniform, walk_mps: { kind: "normal", source: "Knoblauch 1996" }, speed_mps: { kind: "normal", source: "" } })).toBe(
    "walk_mps normal (Knoblauch 1996); speed_mps normal (a choice); all others uniform, a choice.",
  );
});
