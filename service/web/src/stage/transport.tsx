/** Plays, scrubs and frames the stage; everything that a key does has a button. */

import { useEffect, useRef } from "preact/hooks";
import { useSignal } from "../signal";
import { ZOOM_STEP } from "./camera";
import { RATES, useLazyTime } from "./clock";
import { Icon } from "./icons";
import { KEYS, type Controls } from "./keys";
import { signed } from "./labels";
import type { Recording } from "./recording";
import { LAYERS, type Layer, type Layers } from "./scene";

const LAYER_NAMES: Record<Layer, string> = { sight: "Sight", risk: "TTC, RSS", trails: "Trails", labels: "Labels" };

/** A moment that is worth to look at. */
export interface Mark {
  time_s: number;
  name: string;
  kind: "release" | "conflict" | "moment";
}

interface Props extends Controls {
  layers: Layers;
  marks: Mark[];
  /** Spans in which the striker was hidden from the ego. */
  hidden: [number, number][];
  /** What happened at 0 s. */
  moment: Recording["moment"];
}

export function Transport({ clock, tripod, toggle, layers, marks, hidden, moment }: Props) {
  const playing = useSignal(clock.playing);
  const rate = useSignal(clock.rate);
  const follow = useSignal(tripod.follow);
  return (
    <div class="transport">
      <Scrubber {...{ clock, marks, hidden, moment }} />
      <div class="row transport-row" role="group" aria-label="Playback">
        <button onClick={() => clock.seek(clock.start)} aria-label="To the beginning" title="To the beginning (Home)">
          <Icon name="first" />
        </button>
        <button onClick={() => clock.step(-1)} aria-label="One frame back" title="One frame back (←)">
          <Icon name="back" />
        </button>
        <button class="primary play" onClick={() => clock.toggle()} title="Space">
          {playing ? "Pause" : "Play"}
        </button>
        <button onClick={() => clock.step(1)} aria-label="One frame on" title="One frame on (→)">
          <Icon name="on" />
        </button>
        <button onClick={() => clock.seek(clock.end)} aria-label="To the end" title="To the end (End)">
          <Icon name="last" />
        </button>
        <label>
          <span class="hidden-label">Speed</span>
          <select value={String(rate)} onChange={(event) => clock.rate.set(Number(event.currentTarget.value))}>
            {RATES.map((each) => (
              <option value={String(each)}>{each}×</option>
            ))}
          </select>
        </label>
        <span class="transport-jumps row" role="group" aria-label="Jump to">
          {marks.map((mark) => (
            <button class={`jump jump-${mark.kind}`} onClick={() => clock.seek(mark.time_s)}>
              {mark.name}
            </button>
          ))}
        </span>
        <span class="row transport-view" role="group" aria-label="View">
          {LAYERS.map((layer, k) => (
            <button aria-pressed={layers[layer]} onClick={() => toggle(layer)} title={`Key ${k + 1}`}>
              {LAYER_NAMES[layer]}
            </button>
          ))}
          <button aria-pressed={follow} onClick={() => tripod.follow.set(!follow)} title="Key f">
            Follow
          </button>
          <button onClick={() => tripod.fit()} title="The whole conflict in view (0)">
            Fit
          </button>
          <button onClick={() => tripod.zoom(1 / ZOOM_STEP)} aria-label="Farther" title="Farther (−)">
            −
          </button>
          <button onClick={() => tripod.zoom(ZOOM_STEP)} aria-label="Nearer" title="Nearer (+)">
            +
          </button>
        </span>
      </div>
    </div>
  );
}

/** The slider follows the clock by itself, without a rendering for each frame. */
function Scrubber({ clock, marks, hidden, moment }: Pick<Props, "clock" | "marks" | "hidden" | "moment">) {
  const slider = useRef<HTMLInputElement>(null);
  const spoken = inWords(useLazyTime(clock), moment);
  useEffect(() => {
    const moved = () => (slider.current!.value = clock.time.get().toFixed(3));
    moved();
    return clock.time.on(moved);
  }, [clock]);
  const at = (time: number) => (time - clock.start) / (clock.end - clock.start || 1);
  const left = (time: number) => `calc(8px + ${at(time)} * (100% - 16px))`;
  return (
    <div class="scrubber">
      <input
        ref={slider}
        type="range"
        aria-label={`Time from the ${moment}`}
        aria-valuetext={spoken}
        min={clock.start}
        max={clock.end}
        step="any"
        onInput={(event) => {
          clock.pause();
          clock.seek(event.currentTarget.valueAsNumber);
        }}
      />
      <div class="scrubber-marks" aria-hidden="true">
        {hidden.map(([from, to]) => (
          <span class="scrubber-hidden" style={{ left: left(from), width: `calc(${at(to) - at(from)} * (100% - 16px))` }} />
        ))}
        {marks.map(({ time_s, kind }) => (
          <span class={`scrubber-mark mark-${kind}`} style={{ left: left(time_s) }} />
        ))}
      </div>
    </div>
  );
}

export function inWords(time: number, moment: Recording["moment"]): string {
  if (Math.abs(time) < 0.005) return `at the ${moment}`;
  return `${signed(Math.abs(time), 2)} s ${time < 0 ? "before" : "after"} the ${moment}`;
}

export function KeyList() {
  return (
    <details class="keys" open>
      <summary>Keys</summary>
      <dl>
        {KEYS.map(({ shown, does }) => (
          <div>
            <dt>
              <kbd>{shown}</kbd>
            </dt>
            <dd>{does}</dd>
          </div>
        ))}
      </dl>
      <p class="small faint">Drag the stage to move it, turn the wheel to zoom; click or drag in a plot to go there.</p>
    </details>
  );
}
