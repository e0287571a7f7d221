import { expect, it } from "vitest";
import { counted, egoWords, headlineWords, setting, tagsOf } from "./text";

it.each<[number, string]>([
  [2 * Math.PI, "6.283"],
  [1 / 3, "0.3333"],
  [0.1 + 0.2, "0.3"],
  [50 / 3.6, "13.89"],
  [100_000 / 7, "14286"],
  [-2 / 3, "-0.6667"],
  [0.99995, "0.99995"],
  [1e-7, "1e-7"],
  [123456, "123456"],
  [0, "0"],
])("of %d as a setting a reader needs %s", (value, wanted) => expect(setting(value)).toBe(wanted));

it("counts one road and many roads", () => {
  expect([1, 0, 2000].map((roads) => counted(roads, "road"))).toEqual(["1 road", "0 roads", "2,000 roads"]);
});

it.each<[number | null, number, string]>([
  [null, 4, "4 candidates wait for verification"],
  [null, 1, "1 candidate waits for verification"],
  [null, 0, "0 headline failures"],
  [1, 0, "1 headline failure"],
  [0, 4, "0 headline failures, 4 candidates wait for verification"],
])("%j headline failures and %d candidates", (headline, headline_waiting, wanted) => {
  expect(headlineWords({ headline, headline_waiting })).toBe(wanted);
});

it.each<[string | null, string | null, string[], string]>([
  [null, null, [], "default, Krauss"],
  ["idm-aeb", "1.4", ["latency", "blind-right"], "idm-aeb 1.4 + latency + blind-right"],
])("ego of driver %j, version %j, with defects %j", (driver, label, defects, wanted) => {
  expect(egoWords({ profile: "default", car_following: "Krauss", driver, label, defects })).toBe(wanted);
});

it("reads tags as the words of a text, each once", () => {
  expect(tagsOf(" Nightly,release:2.1  nightly ,")).toEqual(["nightly", "release:2.1"]);
  expect(tagsOf(" , ")).toEqual([]);
});
