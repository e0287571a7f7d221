import { expect, test } from "vitest";
import { inTab, isNarrowed, passing, queryOf, read, reset, tally } from "./filters";
import { foundOf } from "./found";
import { sample } from "./sample";

const table = sample(40);
const of = (query: string) => read(new URLSearchParams(query));

test("filters survive the address, and what is as usual is not in it", () => {
  const query = "by=episode&family=low&kind=cut-in%2C+ahead&q=left+speeding&sort=closing&x=ego_speed&brush=closing%3A5%3A";
  const kept = Object.entries(queryOf(of(query))).filter(([, value]) => value);
  expect(new URLSearchParams(kept).toString()).toBe(query);
  expect(Object.values(queryOf(of(""))).join("")).toBe("");
});

test("an order that is not known, or inherited, is the usual one", () => {
  expect(of("sort=constructor").sort).toBe("severity");
  expect(of("tab=x").tab).toBe("failures");
});

test("a tab holds failures or refused contacts", () => {
  const all = table.ids.map((_, i) => i);
  expect(inTab(table, of(""))).toEqual(all.filter((i) => i % 4 !== 3));
  expect(inTab(table, of("tab=refused"))).toEqual(all.filter((i) => i % 4 === 3));
});

test("facets narrow one another", () => {
  const every = inTab(table, of("by=episode"));
  const left = passing(table, every, of("family=low&grade=preventable&broke=speeding"));
  expect(left).toEqual(every.filter((i) => i % 2 === 0 && i % 3 === 0 && i % 5 === 0));
  expect(left.length).toBeGreaterThan(0);
});

test("failures are found by severity, fault, and each driver that would have prevented them", () => {
  const every = inTab(table, of("by=episode"));
  expect(passing(table, every, of("severity=minor&fault=ego"))).toEqual(every.filter((i) => i % 3 === 0));
  expect(passing(table, every, of("prevented_by=full_braking"))).toEqual(every.filter((i) => i % 3 < 2));
  expect(passing(table, every, of("prevented_by=nothing"))).toEqual(every.filter((i) => i % 3 === 2));
});

test("text is looked for word by word, in any case", () => {
  const every = inTab(table, of("by=episode"));
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

test("failures are found by what drove them", () => {
  const every = inTab(table, of(""));
  expect(passing(table, every, of("driven_by=model"))).toEqual(every.filter((i) => i % 5 === 1));
  expect(passing(table, every, of("driven_by=unknown"))).toEqual(every.filter((i) => i % 5 === 4));
});

test("a facet counts episodes, kinds or variants", () => {
  const every = inTab(table, of(""));
  expect(tally(table, every, "family")).toEqual([["low", 20], ["mixed", 10]]);
  expect(tally(table, every, "family", "variant")).toEqual([["low", 4], ["mixed", 2]]);
  expect(tally(table, every, "family", "kind")).toEqual([["low", 1], ["mixed", 1]]);
});

test("a variant tells its episodes, and the methods that found it; a kind its variants", () => {
  const few = sample(6, { variant: [0, 0, 0, 1, null, null], valid: [true, true, true, true, false, false], kind: [0, 0, 0, 0, 0, 1], methods: ["random", "archive", "archive", "random", "random", "random"] });
  const [first, second, , other] = foundOf(few, "variant");
  expect(first).toBe(second);
  expect(first).toMatchObject({ episodes: 3, runs: 2, methods: ["archive", "random"] });
  expect(other).toMatchObject({ episodes: 1, methods: ["random"], drivers: ["random"] });
  expect(foundOf(few, "kind")[3]).toMatchObject({ episodes: 4, variants: 2 });
});

test("a reset leaves tab, order and axes", () => {
  const filters = of("tab=refused&rule=ego_moving&q=x&sort=newest&x=ttc&brush=closing:1:");
  expect(isNarrowed(filters)).toBe(true);
  expect(isNarrowed(reset(filters))).toBe(false);
  expect(reset(filters)).toMatchObject({ tab: "refused", sort: "newest", x: "ttc" });
});
