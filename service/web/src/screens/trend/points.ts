/** A row of a trend as what its charts draw. Pure. */

import type { Body } from "../../api/types";
import { words } from "../../ui/text";
import { titleOf } from "../new/schema";

export type Row = Body<"TrendRow">;
export type Point = Body<"TrendPoint">;
type Rate = Body<"TrendRate">;

/** A value of one version. */
export interface Spot {
  version: string;
  value: number | null;
  low: number | null;
  high: number | null;
  /** What changed since the version before, in words; empty where both can be compared. */
  change: string;
}

/** `1.4 (defects blind-right)`. */
export function nameOf({ version, settings }: Point): string {
  return settings.length ? `${version} (${settings.join("; ")})` : version;
}

/** `definitions 9 → 10`; empty where nothing changed. */
export function changeOf(points: Point[], at: number): string {
  const { changed, software } = points[at]!;
  return changed.map((name) => `${name} ${points[at - 1]!.software[name]} → ${software[name]}`).join(", ");
}

/** A value of each version, with an interval where it has one. */
export function spots(points: Point[], valueOf: (point: Point) => number | Interval | null | undefined): Spot[] {
  return points.map((point, at) => {
    const value = valueOf(point);
    const told = typeof value === "object" && value !== null ? value : { rate: value ?? null, low: null, high: null };
    return { version: nameOf(point), value: told.rate, low: told.low, high: told.high, change: changeOf(points, at) };
  });
}

interface Interval {
  rate: number | null;
  low: number | null;
  high: number | null;
}

/** Scenario and traffic of which a row has rates, each once. */
export function drawnIn({ points }: Row): string[] {
  return [...new Set(points.flatMap((point) => point.rates.map(drawKey)))];
}

export function drawKey({ family, method }: Pick<Rate, "family" | "method">): string {
  return `${family}, ${method === "iid-undisturbed" ? "undisturbed traffic" : method === "iid-random" ? "random adversaries" : "weighted draws"}`;
}

export function rateOf(point: Point, draw: string, requirement: string | null): Rate | undefined {
  return point.rates.find((rate) => drawKey(rate) === draw && rate.requirement === requirement);
}

/** Boxes in which a row's versions have an area, each once. */
export function boxesIn({ points }: Row): string[] {
  return [...new Set(points.flatMap((point) => point.areas.map(boxKey)))];
}

export function boxKey({ family, parameters, driver }: Body<"TrendArea">): string {
  return `${parameters.map((name) => titleOf(name)[0]).join(" and ")} in ${words(family)}: only the ego fails, not ${driver === "r157" ? "R157's driver" : driver.toUpperCase()}`;
}

export type Change = "new" | "returned" | "found" | "gone" | "absent";

/** All kinds of a row, and what became of each in every version; those of the newest version first. */
export function kindsOf({ points }: Row): [string, Change[]][] {
  const names = new Set(points.toReversed().flatMap(({ kinds, gone }) => [...(kinds ?? []), ...(gone ?? [])]));
  return [...names].map((name) => [name, points.map((point) => changeIn(point, name))]);
}

function changeIn(point: Point, kind: string): Change {
  if (point.new?.includes(kind)) return "new";
  if (point.returned?.includes(kind)) return "returned";
  if (point.gone?.includes(kind)) return "gone";
  return point.kinds?.includes(kind) ? "found" : "absent";
}
