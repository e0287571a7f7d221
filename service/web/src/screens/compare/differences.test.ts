import { expect, test } from "vitest";
import { differences } from "./differences";

test("only what differs is named, wherever it lies", () => {
  const one = { label: "a", methods: ["random"], budget: { episodes: 40, cpu_s: null }, ego: { profile: "default" } };
  const other = { label: "b", methods: ["random", "archive"], budget: { episodes: 60, cpu_s: null }, ego: { profile: "default" } };
  expect(differences([one, other])).toEqual([
    { field: "methods", values: ["random", "random, archive"] },
    { field: "budget.episodes", values: ["40", "60"] },
  ]);
  expect(differences([one, one])).toEqual([]);
});

test("what one lacks is a dash, and an empty list says none", () => {
  expect(differences([{ a: [] }, { a: [{ name: "x" }], b: 1 }])).toEqual([
    { field: "a", values: ["none", '{"name":"x"}'] },
    { field: "b", values: ["–", "1"] },
  ]);
});
