/** Where the page is: the address's fragment, `#/campaigns/c1/failures?grade=preventable`, so that any link can be kept. */

import { useEffect, useState } from "preact/hooks";

export interface Place {
  /** What lies between the slashes. */
  parts: string[];
  query: URLSearchParams;
}

export function placeOf(fragment: string): Place {
  const [path = "", query = ""] = fragment.replace(/^#?\/?/, "").split("?", 2);
  return { parts: path.split("/").filter(Boolean).map(decoded), query: new URLSearchParams(query) };
}

/** The address of a place; values that are empty are left out of the query. */
export function address(parts: string[], query: Record<string, string | undefined> = {}): string {
  const kept = Object.entries(query).filter((each): each is [string, string] => !!each[1]);
  const asked = kept.length ? `?${new URLSearchParams(kept)}` : "";
  return `#/${parts.map(encodeURIComponent).join("/")}${asked}`;
}

export function go(to: string): void {
  location.hash = to;
}

/** As `go`, but without a step in the history: for filters and sorting. */
export function replace(to: string): void {
  history.replaceState(null, "", to);
  dispatchEvent(new HashChangeEvent("hashchange"));
}

export function usePlace(): Place {
  const [place, setPlace] = useState(() => placeOf(location.hash));
  useEffect(() => {
    const moved = () => setPlace(placeOf(location.hash));
    addEventListener("hashchange", moved);
    return () => removeEventListener("hashchange", moved);
  }, []);
  return place;
}

function decoded(part: string): string {
  try {
    return decodeURIComponent(part);
  } catch {
    return part; // a stray per cent sign, typed by hand
  }
}
