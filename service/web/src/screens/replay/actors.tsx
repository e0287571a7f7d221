/** What is seen on the stage, as a table: a text alternative, and the numbers. */

import { useLazyTime, type Clock } from "../../stage/clock";
import { instantAt } from "../../stage/interpolate";
import { signed } from "../../stage/labels";
import type { Recording } from "../../stage/recording";
import { dangerousAt, marginsAt, ttcAt } from "../../stage/risk";
import { inWords } from "../../stage/transport";
import { number } from "../../ui/text";

const ROLES = { ego: "ego", striker: "striker", adversary: "adversary", background: "background" };
const LETTERS: Record<string, string> = { G: "green", g: "green, yields", y: "yellow", Y: "yellow", r: "red", u: "red and yellow", s: "stop", o: "blinks", O: "off" };

export function Actors({ recording, clock }: { recording: Recording; clock: Clock }) {
  const time = useLazyTime(clock);
  const instant = instantAt(recording.time_s, time);
  const { series, ids, parts, shape } = recording;
  const at = (rows: (number | null)[][], i: number) => rows[instant.index]?.[i] ?? null;
  const margin = (value: number | null, bad: boolean) => (value === null ? "–" : <span class={bad ? "bad" : ""}>{signed(value)} m</span>);
  const present = ids.map((_, i) => i).filter((i) => at(series.x_m, i) !== null);
  const signal = series.signal[instant.index];
  return (
    <section class="card" aria-live="off" aria-label="Actors at this time">
      <h2>
        Actors {inWords(time, recording.moment)}
        {signal && signal !== "none" && <span class="faint">, {signal} ahead of the ego</span>}
      </h2>
      <div class="scroll" tabIndex={0} role="region" aria-label="Table of actors">
        <table class="actors">
          <thead>
            <tr>
              <th scope="col">Actor</th>
              <th scope="col">Role</th>
              <th scope="col" class="number">Speed</th>
              <th scope="col" class="number">Acceleration</th>
              <th scope="col" class="number">Distance</th>
              <th scope="col" class="number">TTC</th>
              <th scope="col" class="number">RSS along</th>
              <th scope="col" class="number">RSS across</th>
              <th scope="col">To the ego</th>
              <th scope="col">Signal ahead</th>
            </tr>
          </thead>
          <tbody>
            {present.map((i) => {
              const ttc = i === 0 ? null : ttcAt({ recording, instant }, i);
              const { along, across } = marginsAt({ recording, instant }, i);
              const dangerous = dangerousAt({ recording, instant }, i);
              const letter = series.link?.[instant.index]?.[i];
              return (
                <tr class={`actor-${parts[i]}`}>
                  <th scope="row">{ids[i]}</th>
                  <td>
                    {parts[i] === "striker" && recording.moment === "violation" ? "nearest" : ROLES[parts[i]!]}
                    {shape[i] === "person" && ", on foot"}
                  </td>
                  <td class="number">{number(at(series.speed_mps, i), 1)} m/s</td>
                  <td class="number">{signed(at(series.accel_mps2, i) ?? Number.NaN)} m/s²</td>
                  <td class="number">{i === 0 ? "–" : `${number(at(series.distance_m, i), 1)} m`}</td>
                  <td class="number">{ttc === null ? "–" : `${ttc.toFixed(1)} s`}</td>
                  <td class="number">{margin(along, dangerous)}</td>
                  <td class="number">{margin(across, dangerous)}</td>
                  <td>{i === 0 ? "–" : series.visible[instant.index]?.[i] ? "in view" : "not seen"}</td>
                  <td>{letter ? (LETTERS[letter] ?? letter) : "–"}</td>
                </tr>
              );
            })}
          </tbody>
        </table>
      </div>
    </section>
  );
}
