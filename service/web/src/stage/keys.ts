/** The keys of a replay: one table, by which they act and are listed. */

import { useEffect } from "preact/hooks";
import { ZOOM_STEP, type Tripod } from "./camera";
import type { Clock } from "./clock";
import type { Layer } from "./scene";

export interface Controls {
  clock: Clock;
  tripod: Tripod;
  toggle: (layer: Layer) => void;
}

interface Key {
  /** As `KeyboardEvent.key` has them. */
  keys: string[];
  /** As it is listed. */
  shown: string;
  does: string;
  act: (controls: Controls) => void;
}

const PAN_PX = 60;

export const KEYS: Key[] = [
  { keys: [" "], shown: "space", does: "play, pause", act: ({ clock }) => clock.toggle() },
  { keys: ["ArrowLeft", ","], shown: "← ,", does: "one frame back", act: ({ clock }) => clock.step(-1) },
  { keys: ["ArrowRight", "."], shown: "→ .", does: "one frame on", act: ({ clock }) => clock.step(1) },
  { keys: ["Home"], shown: "Home", does: "to the beginning", act: ({ clock }) => clock.seek(clock.start) },
  { keys: ["End"], shown: "End", does: "to the end", act: ({ clock }) => clock.seek(clock.end) },
  { keys: ["["], shown: "[", does: "slower", act: ({ clock }) => clock.pace(-1) },
  { keys: ["]"], shown: "]", does: "faster", act: ({ clock }) => clock.pace(1) },
  { keys: ["f"], shown: "f", does: "follow the ego, or let go", act: ({ tripod }) => tripod.follow.set(!tripod.follow.get()) },
  { keys: ["0"], shown: "0", does: "fit the conflict", act: ({ tripod }) => tripod.fit() },
  { keys: ["+", "="], shown: "+", does: "nearer", act: ({ tripod }) => tripod.zoom(ZOOM_STEP) },
  { keys: ["-"], shown: "−", does: "farther", act: ({ tripod }) => tripod.zoom(1 / ZOOM_STEP) },
  { keys: ["a"], shown: "a", does: "move left", act: ({ tripod }) => tripod.pan(PAN_PX, 0) },
  { keys: ["d"], shown: "d", does: "move right", act: ({ tripod }) => tripod.pan(-PAN_PX, 0) },
  { keys: ["w"], shown: "w", does: "move up", act: ({ tripod }) => tripod.pan(0, PAN_PX) },
  { keys: ["s"], shown: "s", does: "move down", act: ({ tripod }) => tripod.pan(0, -PAN_PX) },
  { keys: ["1"], shown: "1", does: "lines of sight", act: ({ toggle }) => toggle("sight") },
  { keys: ["2"], shown: "2", does: "TTC and RSS", act: ({ toggle }) => toggle("risk") },
  { keys: ["3"], shown: "3", does: "trails", act: ({ toggle }) => toggle("trails") },
  { keys: ["4"], shown: "4", does: "labels", act: ({ toggle }) => toggle("labels") },
];

const BY_KEY = new Map(KEYS.flatMap((key) => key.keys.map((name) => [name, key] as const)));

/** Keys act wherever the focus is, but for fields that take them themselves. */
export function useKeys(controls: Controls): void {
  const { clock, tripod, toggle } = controls;
  useEffect(() => {
    const pressed = (event: KeyboardEvent) => {
      const key = BY_KEY.get(event.key);
      if (key === undefined || event.ctrlKey || event.metaKey || event.altKey || takes(event.target, event.key)) return;
      event.preventDefault();
      key.act({ clock, tripod, toggle });
    };
    addEventListener("keydown", pressed);
    return () => removeEventListener("keydown", pressed);
  }, [clock, tripod, toggle]);
}

function takes(target: EventTarget | null, key: string): boolean {
  if (!(target instanceof HTMLElement)) return false;
  if (target instanceof HTMLInputElement) return target.type !== "range" && target.type !== "checkbox";
  if (target.matches("textarea, select, [role=tab]")) return true;
  return key === " " && target.matches("button, a, summary");
}
