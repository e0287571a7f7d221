/** One figure of an ego over its versions: a spot for each, with its interval, and no line where unlike would be compared. */

import { useId } from "preact/hooks";
import { niceEnd, percentAlong } from "../compare/scale";
import type { Spot } from "./points";

interface Props {
  title: string;
  about: string;
  spots: Spot[];
  /** Says a value. */
  say: (value: number) => string;
}

const TOP = 28; // below what a break says
const BOTTOM = 150;
const LEFT = 14; // per cent, for the values of the levels
const LATE = 60; // per cent, from which on a break says itself to its left
const LABELS = 8; // of versions below a chart, at most

export function VersionChart({ title, about, spots, say }: Props) {
  const id = useId();
  const known = spots.flatMap(({ value, high }) => (value === null ? [] : [high ?? value]));
  const end = niceEnd(Math.max(0, ...known));
  const x = (at: number) => LEFT + ((100 - LEFT) * (at + 0.5)) / spots.length;
  const y = (value: number) => BOTTOM - ((BOTTOM - TOP) * percentAlong(value, 0, end)) / 100;
  const every = Math.ceil(spots.length / LABELS);
  return (
    <figure class="card version-chart">
      <figcaption>
        <h3 id={id}>{title}</h3>
        <span class="faint small">{about}</span>
      </figcaption>
      {known.length === 0 ? (
        <p class="faint">No version has one.</p>
      ) : (
        <>
          <svg role="img" aria-labelledby={id} aria-describedby={`${id}-said`} height={BOTTOM + 8}>
            {[0, end / 2, end].map((value) => (
              <g key={value}>
                <line class="level" x1="0" x2="100%" y1={y(value)} y2={y(value)} />
                {(value > 0 || end < 1) && (
                  <text x="2" y={y(value) - 3}>
                    {say(value)}
                  </text>
                )}
              </g>
            ))}
            {spots.map(({ change }, at) => change && <Break key={at} at={x(at - 0.5)} change={change} />)}
            {spots.map((spot, at) => {
              const before = spots[at - 1];
              const joined = before && !spot.change && before.value !== null && spot.value !== null;
              return joined && <line key={at} class="joined-spots" x1={`${x(at - 1)}%`} x2={`${x(at)}%`} y1={y(before.value!)} y2={y(spot.value!)} />;
            })}
            {spots.map((spot, at) => (
              <Drawn key={at} spot={spot} x={`${x(at)}%`} y={y} said={saidOf(spot, say)} />
            ))}
          </svg>
          <ol class="versions" aria-hidden="true" style={{ marginLeft: `${LEFT}%`, gridTemplateColumns: `repeat(${Math.ceil(spots.length / every)}, minmax(0, 1fr))` }}>
            {spots.map(({ version }, at) => at % every === 0 && (
              <li key={at} title={version}>
                {version}
              </li>
            ))}
          </ol>
          <p class="hidden-label" id={`${id}-said`}>
            {spots.map((spot) => saidOf(spot, say)).join(". ")}
          </p>
        </>
      )}
    </figure>
  );
}

function Break({ at, change }: { at: number; change: string }) {
  const [x, late] = [`${at}%`, at > LATE];
  return (
    <g class="break" data-change={change}>
      <title>Not comparable: {change}</title>
      <line x1={x} x2={x} y1="4" y2={BOTTOM} />
      <text x={x} y="12" dx={late ? -4 : 4} text-anchor={late ? "end" : "start"}>
        {change}
      </text>
    </g>
  );
}

function Drawn({ spot, x, y, said }: { spot: Spot; x: string; y: (value: number) => number; said: string }) {
  if (spot.value === null) return null;
  return (
    <g class="spot">
      <title>{said}</title>
      {spot.low !== null && spot.high !== null && <line x1={x} x2={x} y1={y(spot.low)} y2={y(spot.high)} />}
      <circle cx={x} cy={y(spot.value)} r="5" />
    </g>
  );
}

function saidOf({ version, value, low, high, change }: Spot, say: (value: number) => string): string {
  const interval = low === null || high === null ? "" : `, between ${say(low)} and ${say(high)}`;
  const broken = change ? `, not comparable with the version before: ${change}` : "";
  return `${version}: ${value === null ? "unknown" : say(value)}${interval}${broken}`;
}
