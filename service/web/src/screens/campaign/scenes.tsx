/** What the scenes tell: which parameters set failing ones apart, and which cells of two parameters were played. */

import { useState } from "preact/hooks";
import { useAsked } from "../../api/asked";
import { ended } from "../../api/ended";
import type { Body } from "../../api/types";
import { Empty, Shown } from "../../ui/states";
import { count } from "../../ui/text";
import { titleOf } from "../new/schema";
import { Matrix } from "./matrix";

type Family = Body<"FamilySceneEffects">;
type Parameter = Body<"SceneParameterEffect">;

const AGAIN_MS = 15_000;
const CLEAR = 0.05;

export function Scenes({ campaign }: { campaign: Body<"Campaign"> }) {
  const over = ended(campaign);
  const asked = useAsked<Body<"SceneEffects">>(`v1/campaigns/${encodeURIComponent(campaign.id)}/scenes`, () => (over ? null : AGAIN_MS));
  const [chosen, choose] = useState("");
  return (
    <section aria-labelledby="scenes-title">
      <div class="row over-row">
        <h2 id="scenes-title">Scene parameters</h2>
        {(asked.value?.families.length ?? 0) > 1 && (
          <span class="joined" role="group" aria-label="Family of the scenes">
            {asked.value!.families.map(({ family }, i) => (
              <button key={family} aria-pressed={family === chosen || (i === 0 && !chosen)} onClick={() => choose(family)}>
                {family}
              </button>
            ))}
          </span>
        )}
      </div>
      <Shown asked={asked} what="the scenes">
        {({ families }) => {
          const family = families.find((each) => each.family === chosen) ?? families[0];
          return family ? <OfFamily key={family.family} family={family} /> : <Empty>No scene was played yet.</Empty>;
        }}
      </Shown>
    </section>
  );
}

function OfFamily({ family }: { family: Family }) {
  const names = family.parameters.map((parameter) => parameter.name);
  const [rows, setRows] = useState(names[0]!);
  const [columns, setColumns] = useState(names[1] ?? names[0]!);
  return (
    <div class="scenes">
      <div class="card">
        <h3>Importance for failing</h3>
        <p class="small faint">
          {count(family.failures)} failing against {count(family.episodes - family.failures)} safe episodes, by Vargha and Delaney's A12: how
          often a failing scene has the larger value. A search chooses its scenes, so this is a hint and no proof.
        </p>
        <div class="scroll" tabIndex={0} role="region" aria-label="Importance of scene parameters">
          <table class="importance">
            <thead>
              <tr>
                <th>Parameter</th>
                <th>Importance</th>
                <th class="number" title="0.5: failing and safe scenes do not differ">
                  A12
                </th>
                <th>Fails more often at</th>
                <th title="Failures per episode, from the lowest to the highest values; empty: never played">Failures by range</th>
              </tr>
            </thead>
            <tbody>
              {family.parameters.map((parameter) => (
                <Row key={parameter.name} parameter={parameter} />
              ))}
            </tbody>
          </table>
        </div>
      </div>
      <div class="card">
        <h3>Coverage of the ODD</h3>
        <div class="row">
          <Choice label="Down" names={names} chosen={rows} choose={setRows} />
          <Choice label="Across" names={names} chosen={columns} choose={setColumns} />
        </div>
        <Matrix family={family} rows={rows} columns={columns} />
      </div>
    </div>
  );
}

function Row({ parameter }: { parameter: Parameter }) {
  const { name, meaning, effect, p } = parameter;
  const [title] = titleOf(name);
  const importance = effect === null ? null : Math.abs(2 * effect - 1);
  const clear = p !== null && p < CLEAR;
  return (
    <tr class={clear ? undefined : "unclear"} data-parameter={name}>
      <th scope="row" title={meaning}>
        {title}
      </th>
      <td>
        {importance !== null && (
          <span class="bar-track" title={`|2 · A12 − 1| = ${importance.toFixed(2)}, p = ${p!.toFixed(3)}`}>
            <span style={{ width: `${100 * importance}%` }} />
          </span>
        )}
      </td>
      <td class="number">{effect === null ? "–" : effect.toFixed(2)}</td>
      <td>{effect === null ? "–" : clear ? wayOf(parameter, effect) : <span class="faint">no clear difference</span>}</td>
      <td>
        <Rates parameter={parameter} />
      </td>
    </tr>
  );
}

function wayOf({ bins, unit }: Parameter, effect: number): string {
  const [low, high] = [bins[0]!, bins.at(-1)!];
  if (!/^-?[\d.]/.test(low)) return effect > 0.5 ? high : low; // a category
  return `${effect > 0.5 ? "large" : "small"} values${unit && unit !== "1" ? `, ${unit}` : ""}`;
}

const BAR = 12;
const TALL = 22;

/** A bar for each range of the parameter, as high as its share of failures; nothing where nothing was played. */
function Rates({ parameter: { name, bins, played, failed } }: { parameter: Parameter }) {
  const rates = played.map((all, i) => (all ? failed[i]! / all : null));
  const top = Math.max(0.01, ...rates.map((rate) => rate ?? 0));
  const said = bins.map((bin, i) => `${bin}: ${failed[i]} of ${played[i]}`).join("; ");
  return (
    <svg class="rates" width={bins.length * BAR} height={TALL} role="img" aria-label={`Failures of ${titleOf(name)[0]}. ${said}`}>
      <title>{said}</title>
      {rates.map((rate, i) => {
        const tall = rate === null ? 0 : Math.max(1.5, (TALL * rate) / top);
        return <rect key={i} x={i * BAR} y={TALL - tall} width={BAR - 2} height={tall} />;
      })}
    </svg>
  );
}

function Choice({ label, names, chosen, choose }: { label: string; names: string[]; chosen: string; choose: (name: string) => void }) {
  return (
    <label>
      {label}{" "}
      <select value={chosen} onChange={(event) => choose(event.currentTarget.value)}>
        {names.map((name) => (
          <option key={name} value={name}>
            {titleOf(name)[0]}
          </option>
        ))}
      </select>
    </label>
  );
}
