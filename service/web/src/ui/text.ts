/** Numbers and times in words; what is unknown is a dash. */

import type { Body } from "../api/types";

export function number(value: number | null | undefined, digits = 2): string {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  return value.toFixed(digits).replace(/^-(?=[0.]*$)/, ""); // no minus before a zero
}

/** A setting as it was written; one that was computed, such as 2π, with four digits. */
export function setting(value: number): string {
  if (Number(value.toPrecision(8)) === value) return String(value);
  const whole = Math.trunc(Math.abs(value)).toString().length;
  return String(Number(value.toPrecision(Math.max(4, whole))));
}

export function count(value: number): string {
  return value.toLocaleString("en");
}

/** `1 road`, `2,000 roads`. */
export function counted(value: number, noun: string): string {
  return `${count(value)} ${noun}${value === 1 ? "" : "s"}`;
}

interface Headline {
  headline: number | null;
  headline_waiting: number;
}

/** Headline failures, and how many candidates wait for a replay. */
export function headlineWords({ headline, headline_waiting }: Headline): string {
  const known = `${count(headline ?? 0)} headline ${headline === 1 ? "failure" : "failures"}`;
  if (headline_waiting === 0) return known;
  return headline === null ? waitingWords(headline_waiting) : `${known}, ${waitingWords(headline_waiting)}`;
}

export function waitingWords(candidates: number): string {
  return candidates === 1 ? "1 candidate waits for verification" : `${count(candidates)} candidates wait for verification`;
}

export function seconds(value: number | null | undefined): string {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  const whole = Math.round(value);
  if (whole < 60) return `${whole} s`;
  if (whole < 3600) return `${Math.floor(whole / 60)} min ${whole % 60} s`;
  const minutes = Math.round(whole / 60);
  return `${Math.floor(minutes / 60)} h ${minutes % 60} min`;
}

/** What drives the ego: a registered driver, or a profile of SUMO's with its model; its version, and its defects. */
export function egoWords({ profile, car_following, driver, label, defects }: Body<"EgoDriver">): string {
  const name = driver ?? `${profile}, ${car_following}`;
  return [label ? `${name} ${label}` : name, ...(defects ?? [])].join(" + ");
}

/** `red_light` -> `red light`. */
export function words(name: string): string {
  return name.replaceAll("_", " ");
}

export function moment(iso: string | null): string {
  return iso === null ? "–" : new Date(iso).toLocaleString("en-GB", { dateStyle: "medium", timeStyle: "short" });
}

/** A share of one in per cent. */
export function percent(value: number | null | undefined): string {
  return value === null || value === undefined || !Number.isFinite(value) ? "–" : `${(100 * value).toFixed(1)} %`;
}

/** With a capital at the beginning; an identifier stays as it is. */
export function capital(text: string): string {
  return /^\w*_/.test(text) ? text : text.charAt(0).toUpperCase() + text.slice(1);
}

/** `nightly, release:2.1` -> its words; none twice. */
export function tagsOf(text: string): string[] {
  return [...new Set(text.toLowerCase().split(/[\s,]+/).filter(Boolean))];
}
