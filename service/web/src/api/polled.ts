/** Polls, but not while the tab is hidden. */

import { useEffect, useRef, useState } from "preact/hooks";
import { paced } from "./pace";

/**
 * @param key what is asked for: with another one it is asked at once; null to ask nothing.
 * @param ask asks, and says how many milliseconds to wait before the next time; "seen": until the tab comes back to sight;
 *   null: for good.
 * @returns how to ask at once.
 */
export function usePolled(key: string | null, ask: (left: AbortSignal) => Promise<number | "seen" | null>): () => void {
  const [turn, setTurn] = useState(0);
  const latest = useRef(ask);
  latest.current = ask;
  useEffect(() => {
    if (key === null) return;
    const left = new AbortController();
    let timer: ReturnType<typeof setTimeout>;
    const round = async () => {
      const began = performance.now();
      const wait = await latest.current(left.signal);
      const took = performance.now() - began;
      if (left.signal.aborted) return;
      if (wait === "seen") whenSeen();
      else if (wait !== null) timer = setTimeout(next, paced(wait, took));
    };
    const whenSeen = () => document.addEventListener("visibilitychange", next, { once: true, signal: left.signal });
    const next = () => (document.hidden ? whenSeen() : round());
    round();
    return () => {
      left.abort();
      clearTimeout(timer);
    };
  }, [key, turn]);
  return () => setTurn((n) => n + 1);
}
