/** The brushes as numbers: what the pointer does on the axes, by the keyboard. */

import { brushed, type Brushes, type Interval } from "./brushes";
import { setting } from "../../ui/text";
import { titled, type Feature } from "./features";

export function RangesByNumbers({ features, brushes, brush }: { features: readonly Feature[]; brushes: Brushes; brush: (next: Brushes) => void }) {
  const set = (key: string, side: 0 | 1, text: string) => {
    const interval: [number, number] = [...(brushes.get(key) ?? ([-Infinity, Infinity] as Interval))];
    interval[side] = text === "" ? (side ? Infinity : -Infinity) : Number(text);
    if (!Number.isNaN(interval[side])) brush(brushed(brushes, key, interval));
  };
  return (
    <details class="ranges">
      <summary>Ranges by numbers</summary>
      <div class="ranges-grid">
        {features.map((feature) => (
          <fieldset key={feature.key}>
            <legend>{titled(feature)}</legend>
            {(["at least", "at most"] as const).map((words, side) => (
              <input
                key={words}
                type="number"
                step="any"
                placeholder={words}
                aria-label={`${titled(feature)}: ${words}`}
                value={shownEnd(brushes.get(feature.key)?.[side])}
                onChange={(event) => set(feature.key, side as 0 | 1, event.currentTarget.value)}
              />
            ))}
          </fieldset>
        ))}
      </div>
    </details>
  );
}

function shownEnd(end: number | undefined): string {
  return end === undefined || !Number.isFinite(end) ? "" : setting(end);
}
