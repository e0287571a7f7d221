/** A mean with its 95 % interval, drawn to the scale of its column. */

import type { Mark } from "../campaign/look";
import { percentAlong } from "./scale";
import type { Estimate } from "./rows";

interface Drawn {
  estimate: Estimate;
  from: number;
  to: number;
  mark?: Mark;
  /** In words, for screen readers. */
  label: string;
}

const COLOUR = "var(--text)";

export function Interval({ estimate: { mean, low, high }, from, to, mark, label }: Drawn) {
  const x = (value: number) => `${percentAlong(value, from, to)}%`;
  const colour = mark ? `var(${mark.colour})` : COLOUR;
  return (
    <svg class="interval" role="img" aria-label={label} height="18">
      <line class="interval-axis" x1="0" x2="100%" y1="9" y2="9" />
      {from < 0 && <line class="interval-zero" x1={x(0)} x2={x(0)} y1="3" y2="15" />}
      {low !== null && high !== null && (
        <g stroke={colour} stroke-width="2">
          <line x1={x(low)} x2={x(high)} y1="9" y2="9" />
          <line x1={x(low)} x2={x(low)} y1="5" y2="13" />
          <line x1={x(high)} x2={x(high)} y1="5" y2="13" />
        </g>
      )}
      {mean !== null && <circle cx={x(mean)} cy="9" r="4.5" fill={colour} stroke="var(--surface)" stroke-width="1.5" />}
    </svg>
  );
}
