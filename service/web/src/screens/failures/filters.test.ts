import { expect, test } from "vitest";
import { inTab, isNarrowed, oftenOf, passing, queryOf, read, reset, tally } from "./filters";
import { sample } from "./sample";

const table = sample(40);
const of = (query: string) => read(new URLSearchParams(query));

test("filters survive the address, and what is as usual is not in it", () => {
  const query = "every=1&family=low&kind=cut-in%2C+ahead&q=left+speeding&sort=closing&x=ego_speed&brush=closing%3A5%3A";
  const kept = Object.entries(queryOf(of(query))).filter(([, value]) => value);
  expect(new URLSearchParams(kept).toString()).toBe(query);
  expect(Object.values(queryOf(of(""))).join("")).toBe("");
});

test("an order that is not known, or inherited, is the usual one", () => {
  expect(of("sort=constructor").sort).toBe("grade");
  expect(of("tab=x").tab).toBe("failures");
});

test("distinct failures, every failure and refused contacts", () => {
  const all = table.ids.map((_, i) => i);
  expect(inTab(table, of(""))).toEqual(all.filter((i) => i % 4 === 0));
  expect(inTab(table, of("every=1"))).toEqual(all.filter((i) => i % 4 !== 3));
  expect(inTab(table, of("tab=refused"))).toEqual(all.filter((i) => i % 4 === 3));
});

test("facets narrow one another", () => {
  const every = inTab(table, of("every=1"));
  const left = passing(table, every, of("family=low&grade=preventable&broke=speeding"));
  expect(left).toEqual(every.filter((i) => i % 2 === 0 && i % 3 === 0 && i % 5 === 0));
  expect(left.length).toBeGreaterThan(0);
});

test("failures are found by severity, fault, and each driver that would have prevented them", () => {
  const every = inTab(table, of("every=1"));
  expect(passing(table, every, of("severity=minor&fault=ego"))).toEqual(every.filter((i) => i % 3 === 0));
  expect(passing(table, every, of("prevented_by=full_braking"))).toEqual(every.filter((i) => i % 3 < 2));
  expect(passing(table, every, of("prevented_by=nothing"))).toEqual(every.filter((i) => i % 3 === 2));
});

test("text is looked for word by word, in any case", () => {
  const every = inTab(table, of("every=1"));
  expect(passing(table, every, of("q=HIDING ped"))).toEqual(every.filter((i) => i % 2 === 1));
  expect(passing(table, every, of("q=hiding left"))).toEqual([]);
  expect(passing(table, every, of("q=+"))).toEqual(every);
});

test("a contact that two rules refused counts for both", () => {
  const refused = inTab(table, of("tab=refused"));
  expect(tally(table, refused, "rule")).toEqual([
    ["no_sideswipe", 10],
    ["ego_moving", 5],
  ]);
  expect(passing(table, refused, of("tab=refused&rule=ego_moving"))).toHaveLength(5);
});

test("how often a kind came counts valid failures alone", () => {
  const often = oftenOf(table);
  expect(often[0]).toBe(20); // even ones are all valid
  expect(often[1]).toBe(10); // every second odd one was refused
});

test("a reset leaves tab, order and axes", () => {
  const filters = of("tab=refused&rule=ego_moving&q=x&sort=newest&x=ttc&brush=closing:1:");
  expect(isNarrowed(filters)).toBe(true);
  expect(isNarrowed(reset(filters))).toBe(false);
  expect(reset(filters)).toMatchObject({ tab: "refused", sort: "newest", x: "ttc" });
});
