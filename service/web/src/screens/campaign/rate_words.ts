/** Rates in words: they range over many powers of ten. */

import type { Body } from "../../api/types";

/** With three digits; below a thousandth as a power of ten. */
export function small(rate: number): string {
  if (rate === 0 || rate >= 1e-3) return String(Number(rate.toPrecision(3)));
  return rate.toExponential(2).replace("e-", " × 10⁻").replace(/⁻\d+$/, (digits) => `⁻${[...digits.slice(1)].map((digit) => "⁰¹²³⁴⁵⁶⁷⁸⁹"[Number(digit)]).join("")}`);
}

export function within({ low, high }: { low: number | null; high: number | null }): string {
  return low === null || high === null ? "–" : `${small(low)} to ${small(high)}`;
}

/** Which parameters have a distribution, by kind and source; all others are uniform. */
export function shared(distributions: Record<string, Body<"DeclaredParameter">>): string {
  const declared = Object.entries(distributions).filter(([, { kind }]) => kind !== "uniform");
  if (!declared.length) return "uniform over all parameters, a choice.";
  const told = declared.map(([name, { kind, source }]) => `${name} ${kind} (${source || "a choice"})`);
  return `${told.join("; ")}; all others uniform, a choice.`;
}
