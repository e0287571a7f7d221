/** One map: where the patterns fit on it, why elsewhere they do not, and a way to a campaign there. */

import type { ComponentChildren } from "preact";
import { useState } from "preact/hooks";
import { useAsked } from "../../api/asked";
import type { Body } from "../../api/types";
import { usePicture } from "../../ui/picture";
import { Shown } from "../../ui/states";
import { count, moment } from "../../ui/text";
import { useTitle } from "../../ui/title";
import { again, begin, matching, MOST_PLACES, PATTERNS, type Pattern, type Places, type Spot } from "./places";
import { nameOf } from "./screen";
import "./maps.css";

const SHOWN = 50; // rows at once

export function MapScreen({ id, query }: { id: string; query: URLSearchParams }) {
  const asked = useAsked<Body<"Network">>(`v1/networks/${encodeURIComponent(id)}`);
  useTitle(asked.value && nameOf(asked.value), "Maps");
  const places = useAsked<Places>(asked.value ? `v1/networks/${id}/places` : null, again);
  return (
    <Shown asked={asked} what="the map">
      {(map) => (
        <div class="maps grid">
          <div class="head">
            <span class="crumbs">
              <a href="#/maps">Maps</a>
            </span>
            <h1 title={nameOf(map)}>{nameOf(map)}</h1>
            <span class="faint">
              {count(map.edges)} roads, {count(map.junctions)} junctions, {(map.length_m / 1000).toFixed(1)} km
            </span>
          </div>
          {query.has("known") && (
            <p class="card" role="status">
              This map was uploaded before, on {moment(map.created_at)}. It was not added again, and keeps its label.
            </p>
          )}
          <Warnings said={map.warnings} />
          <Shown asked={places} what="the places, which may take a minute">
            {(found) =>
              found.progress < 1 ? (
                <p class="faint">Searching for places: {Math.round(100 * found.progress)} %</p>
              ) : (
                <>
                  <Patterns id={id} found={found} />
                  <div class="map-parts">
                    <Picture id={id} />
                    <Listed id={id} found={found} />
                  </div>
                </>
              )
            }
          </Shown>
        </div>
      )}
    </Shown>
  );
}

function Warnings({ said }: { said: readonly string[] }) {
  if (said.length === 0) return null;
  return (
    <details class="card map-warnings">
      <summary>
        {count(said.length)} {said.length === 1 ? "warning" : "warnings"} from its check
      </summary>
      <ul class="small breaking">
        {said.map((each) => (
          <li key={each}>{each}</li>
        ))}
      </ul>
    </details>
  );
}

/** A card for each pattern, with how often it fits. */
function Patterns({ id, found }: { id: string; found: Places }) {
  return (
    <div class="map-patterns">
      {PATTERNS.map(({ name, title, about }) => {
        const fits = matching(found.items, name, "").length;
        return (
          <section key={name} class="card" aria-label={title}>
            <h2>{title}</h2>
            <p class="small faint">{about}</p>
            <p>
              <b>{count(fits)}</b> {fits === 1 ? "place" : "places"}{" "}
              <span class="faint">· does not fit at {count(matching(found.elsewhere, name, "").length)}</span>
            </p>
            {fits > 0 && fits <= MOST_PLACES && (
              <a class="button" href={begin(id, name, null)}>
                {fits === 1 ? "Start a campaign there" : `Start a campaign at all ${count(fits)}`}
              </a>
            )}
            {fits > MOST_PLACES && <p class="small faint">Choose one below: a campaign takes {MOST_PLACES} at most.</p>}
          </section>
        );
      })}
    </div>
  );
}

function Picture({ id }: { id: string }) {
  const { url, error } = usePicture(`v1/networks/${id}/places.png`);
  return (
    <figure class="card map-picture">
      {url ? <img src={url} alt="The map from above with the places that were found" /> : <span class="faint">{error ?? "Loading …"}</span>}
    </figure>
  );
}

function Listed({ id, found }: { id: string; found: Places }) {
  const [pattern, setPattern] = useState<Pattern | "">("");
  const [text, setText] = useState("");
  const [most, setMost] = useState(SHOWN);
  const fits = matching(found.items, pattern, text);
  const misfits = matching(found.elsewhere, pattern, text);
  return (
    <section class="card map-places" aria-label="Places">
      <div class="row">
        <label>
          Pattern{" "}
          <select value={pattern} onChange={(event) => setPattern(event.currentTarget.value as Pattern | "")}>
            <option value="">all</option>
            {PATTERNS.map(({ name, title }) => (
              <option key={name} value={name}>
                {title}
              </option>
            ))}
          </select>
        </label>
        <label>
          Search <input value={text} placeholder="a road or a word" onInput={(event) => setText(event.currentTarget.value)} />
        </label>
      </div>
      <h2>
        {count(fits.length)} {fits.length === 1 ? "place" : "places"}
      </h2>
      <ul class="spots">
        {fits.slice(0, most).map((spot) => (
          <Row key={spot.pattern + spot.place} spot={spot} said={spot.summary}>
            <a class="button" href={begin(id, spot.pattern, spot.place)} aria-label={`Start a campaign: ${titled(spot)} at ${spot.place}`}>
              Start
            </a>
          </Row>
        ))}
      </ul>
      {fits.length > most && <button onClick={() => setMost(most + SHOWN)}>Show more</button>}
      <details class="map-elsewhere">
        <summary>Where no pattern fits ({count(misfits.length)})</summary>
        <ul class="spots">
          {misfits.slice(0, most).map((spot) => (
            <Row key={spot.pattern + spot.place} spot={spot} said={spot.why} />
          ))}
        </ul>
        {misfits.length > most && <button onClick={() => setMost(most + SHOWN)}>Show more</button>}
      </details>
    </section>
  );
}

function Row({ spot, said, children }: { spot: Spot; said: string; children?: ComponentChildren }) {
  return (
    <li>
      <span>
        <span class="tag">{titled(spot)}</span> <code class="breaking">{spot.place}</code>
        <span class="small faint said breaking">{said}</span>
      </span>
      {children}
    </li>
  );
}

function titled(spot: Spot): string {
  return PATTERNS.find(({ name }) => name === spot.pattern)?.title ?? spot.pattern;
}
