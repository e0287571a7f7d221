/** A campaign on a map of the user's: the places that take the place of families. */

import { useAsked } from "../../api/asked";
import { address } from "../../router";
import { count } from "../../ui/text";
import { again, matching, PATTERNS, type Pattern, type Places } from "../maps/places";
import { useField } from "./form";
import { Wrongs } from "./field";
import type { Values } from "./schema";

export interface Ground {
  network: string;
  pattern: Pattern;
  /** Null: all of the pattern. */
  place: string | null;
}

/** Where the form's address says that a campaign is to be run; null where it names no map. */
export function groundOf(query: URLSearchParams): Ground | null {
  const network = query.get("network");
  const pattern = PATTERNS.find(({ name }) => name === query.get("pattern"))?.name;
  return network && pattern ? { network, pattern, place: query.get("place") } : null;
}

/** The same campaign, at places in place of families. */
export function grounded({ network, pattern, place }: Ground, body: Values): Values {
  const rest = Object.entries(body).filter(([name]) => name !== "families" && name !== "odd");
  return { network, pattern, ...(place === null ? { places: "all" } : { place }), ...Object.fromEntries(rest) };
}

/** How many places that is; undefined until it is known. */
export function useExtent(ground: Ground | null): number | undefined {
  const found = useAsked<Places>(ground && ground.place === null ? `v1/networks/${encodeURIComponent(ground.network)}/places` : null, again).value;
  if (ground?.place === null) return found && matching(found.items, ground.pattern, "").length;
  return ground ? 1 : undefined;
}

export function OnMap({ ground: { network, pattern, place }, extent }: { ground: Ground; extent: number | undefined }) {
  const wrong = ["network", "pattern", "place", "places"].flatMap((name) => useField([name]).wrong);
  return (
    <div class={wrong.length ? "field is-wrong" : "field"} id="field-network">
      <p class="ground">
        <b>{PATTERNS.find(({ name }) => name === pattern)!.title}</b> {place === null ? `at all ${extent === undefined ? "" : count(extent)} places` : "at "}
        {place !== null && <code>{place}</code>} of <a href={address(["maps", network])}>a map of yours</a>
      </p>
      <Wrongs id="field-network" wrong={wrong} />
      <p class="help">Each place brings scene parameters and an operational design domain of its own roads.</p>
    </div>
  );
}
