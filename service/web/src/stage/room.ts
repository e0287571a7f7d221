/** What replay and pair share: moments, what the camera fits, layers, and the time in the address. */

import { useCallback, useEffect, useRef } from "preact/hooks";
import { placeOf, replace } from "../router";
import { signal, useSignal } from "../signal";
import type { Clock } from "./clock";
import { boundsOf, type Bounds } from "./geometry";
import { opening } from "./panels";
import type { Recording } from "./recording";
import type { Layer, Layers } from "./scene";
import type { Mark } from "./transport";

const AFTER_S = 1; // of the moment: what the camera fits still

export function marksOf({ released_s, conflict_s, moment }: Recording): Mark[] {
  const marks: Mark[] = [{ time_s: released_s, name: "Release", kind: "release" }];
  if (conflict_s !== null) marks.push({ time_s: conflict_s, name: "Conflict", kind: "conflict" });
  return [...marks, { time_s: 0, name: moment === "contact" ? "Contact" : "Violation", kind: "moment" }];
}

/** The ways of ego and striker through the conflict. */
export function conflictBounds(recording: Recording): Bounds | null {
  const from = opening(recording);
  const { actors, striker, time_s, x_m, y_m } = recording;
  const points: [number, number][] = [];
  time_s.forEach((time, step) => {
    if (time < from || time > AFTER_S) return;
    for (const actor of striker < 0 ? [0] : [0, striker]) points.push([x_m[step * actors + actor]!, y_m[step * actors + actor]!]);
  });
  return boundsOf(points);
}

/** Of the whole page, so that the next failure is shown as this one. */
const layers = signal<Layers>({ sight: true, risk: true, trails: true, labels: true });

export function useLayers(): [Layers, (layer: Layer) => void] {
  const shown = useSignal(layers);
  const toggle = useCallback((layer: Layer) => layers.set({ ...layers.get(), [layer]: !layers.get()[layer] }), []);
  return [shown, toggle];
}

/** The time that an address asks for; null if it asks for none. */
export function askedTime(query: URLSearchParams): number | null {
  const asked = query.get("t");
  const time = asked === null || asked === "" ? Number.NaN : Number(asked);
  return Number.isFinite(time) ? time : null;
}

const REST_MS = 250;

/** Keeps the time in the address once it rests, and goes where an address that was changed by hand says. */
export function useTimeInAddress(clock: Clock, query: URLSearchParams): void {
  const written = useRef(query.get("t"));
  useEffect(() => {
    const time = askedTime(query);
    if (time !== null && query.get("t") !== written.current) clock.seek(time);
    written.current = query.get("t");
  }, [clock, query.get("t")]);
  useEffect(() => {
    let timer: ReturnType<typeof setTimeout>;
    const write = () => {
      const text = clock.time.get().toFixed(2);
      if (clock.playing.get() || text === written.current) return;
      const kept = placeOf(location.hash).query;
      if (kept.get("t") !== written.current) return; // the user has just changed it: that goes first
      written.current = text;
      const [path] = location.hash.split("?", 1);
      kept.set("t", text);
      replace(`${path}?${kept}`);
    };
    const changed = () => {
      clearTimeout(timer);
      if (!clock.playing.get()) timer = setTimeout(write, REST_MS);
    };
    const leave = [clock.time.on(changed), clock.playing.on(changed)];
    return () => {
      clearTimeout(timer);
      leave.forEach((off) => off());
    };
  }, [clock]);
}

/** Stops the clock of a screen that is left. */
export function useStopped(clock: Clock): void {
  useEffect(() => () => clock.pause(), [clock]);
}
