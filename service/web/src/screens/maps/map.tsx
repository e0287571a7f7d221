/** One map: where the patterns fit on it, why elsewhere they do not, and a way to a campaign there. */

import type { ComponentChildren } from "preact";
import { useEffect, useMemo, useRef, useState } from "preact/hooks";
import { useAsked } from "../../api/asked";
import type { Body } from "../../api/types";
import { Shown } from "../../ui/states";
import { count, counted, moment } from "../../ui/text";
import { useTitle } from "../../ui/title";
import { again, begin, matching, MOST_PLACES, PATTERNS, type Pattern, type Places, type Spot } from "./places";
import { Plan, Sign } from "./plan";
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
              {counted(map.edges, "road")}, {counted(map.junctions, "junction")}, {(map.length_m / 1000).toFixed(1)} km
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
                  <Found id={id} found={found} />
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

/** The places as a list and on the map: what is chosen in one is shown in both. */
function Found({ id, found }: { id: string; found: Places }) {
  const [pattern, setPattern] = useState<Pattern | "">("");
  const [text, setText] = useState("");
  const [chosen, setChosen] = useState<Spot>();
  const fits = useMemo(() => matching(found.items, pattern, text), [found, pattern, text]);
  const misfits = useMemo(() => matching(found.elsewhere, pattern, text), [found, pattern, text]);
  const spots = useMemo<Spot[]>(() => [...fits, ...misfits], [fits, misfits]);
  const shown = chosen && spots.includes(chosen) ? chosen : undefined;
  const start = (spot: Spot) => (
    <a class="button" href={begin(id, spot.pattern, spot.place)} aria-label={`Start a campaign: ${titled(spot)} at ${spot.place}`}>
      Start
    </a>
  );
  return (
    <div class="map-parts">
      <Plan id={id} spots={spots} chosen={shown} choose={setChosen} />
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
            Search <input type="search" value={text} placeholder="a road or a word" onInput={(event) => setText(event.currentTarget.value)} />
          </label>
        </div>
        <h2>
          {count(fits.length)} {fits.length === 1 ? "place" : "places"}
        </h2>
        <Spots spots={fits} chosen={shown} choose={setChosen} beside={start} />
        <details class="map-elsewhere" open={shown && "why" in shown}>
          <summary>Where no pattern fits ({count(misfits.length)})</summary>
          <Spots spots={misfits} chosen={shown} choose={setChosen} />
        </details>
      </section>
    </div>
  );
}

interface Lines {
  spots: readonly Spot[];
  chosen: Spot | undefined;
  choose: (spot: Spot | undefined) => void;
  beside?: (spot: Spot) => ComponentChildren;
}

function Spots({ spots, chosen, choose, beside }: Lines) {
  const [wanted, setWanted] = useState(SHOWN);
  const most = Math.max(wanted, chosen ? spots.indexOf(chosen) + 1 : 0);
  return (
    <>
      <ul class="spots">
        {spots.slice(0, most).map((spot) => (
          <Row key={spot.pattern + spot.place} spot={spot} on={spot === chosen} choose={() => choose(spot === chosen ? undefined : spot)}>
            {beside?.(spot)}
          </Row>
        ))}
      </ul>
      {spots.length > most && <button onClick={() => setWanted(most + SHOWN)}>Show more</button>}
    </>
  );
}

function Row({ spot, on, choose, children }: { spot: Spot; on: boolean; choose: () => void; children: ComponentChildren }) {
  const line = useRef<HTMLLIElement>(null);
  useEffect(() => {
    if (on) line.current!.scrollIntoView({ block: "nearest" });
  }, [on]);
  return (
    <li ref={line} class={on ? "spot-on" : undefined} aria-current={on}>
      <span>
        <button class="spot" title="Show it on the map" onClick={choose}>
          <Sign pattern={"summary" in spot ? spot.pattern : null} /> {titled(spot)} <code class="breaking">{spot.place}</code>
        </button>
        <span class="small faint said breaking">{"summary" in spot ? spot.summary : spot.why}</span>
      </span>
      {children}
    </li>
  );
}

function titled(spot: Spot): string {
  return PATTERNS.find(({ name }) => name === spot.pattern)?.title ?? spot.pattern;
}
