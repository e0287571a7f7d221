/** A range with two thumbs on one track, and a number beside each for exact values. */

import { setting } from "../../ui/text";
import { moved, share, type Range, type Scale } from "./range";

interface Ranged {
  id: string;
  title: string;
  unit: string;
  value: Range;
  scale: Scale;
  change: (value: Range) => void;
}

const ENDS = ["low", "high"] as const;
const SAID = { low: "lowest", high: "highest" };

export function RangeInput({ id, title, unit, value, scale, change }: Ranged) {
  const move = (end: keyof Range, to: number) => {
    if (Number.isFinite(to)) change(moved(value, end, to, scale));
  };
  const typed = (end: keyof Range) => (
    <span class="control">
      <input
        id={`${id}-${end}`}
        type="number"
        aria-label={`${title}, ${SAID[end]}`}
        min={scale.low}
        max={scale.high}
        step="any"
        value={setting(value[end])}
        onChange={(event) => move(end, event.currentTarget.valueAsNumber)}
      />
    </span>
  );
  const left = 100 * share(value.low, scale);
  const right = 100 * share(value.high, scale);
  return (
    <div class="range">
      {typed("low")}
      <span class="track">
        <span class="track-on" style={{ left: `${left}%`, width: `${right - left}%` }} />
        {ENDS.map((end) => (
          <input
            key={end}
            type="range"
            class={end === "low" && left > 50 ? "thumb above" : "thumb"}
            aria-label={`${title}, ${SAID[end]}, by a slider`}
            aria-valuetext={`${setting(value[end])} ${unit}`}
            min={scale.low}
            max={scale.high}
            step="any"
            value={value[end]}
            onInput={(event) => {
              move(end, event.currentTarget.valueAsNumber);
              event.currentTarget.value = String(moved(value, end, event.currentTarget.valueAsNumber, scale)[end]);
            }}
            onKeyDown={(event) => {
              const steps = STEPS[event.key];
              if (steps === undefined) return;
              event.preventDefault();
              move(end, value[end] + steps * scale.step);
            }}
          />
        ))}
      </span>
      {typed("high")}
      <span class="faint unit">{unit}</span>
    </div>
  );
}

/** With `step="any"` the browser's own steps are a hundredth of the scale, whatever that is. */
const STEPS: Record<string, number> = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1, PageDown: -10, PageUp: 10 };
