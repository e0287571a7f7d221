/** What a component asks of the API: loading, then there or refused; asked again as often as it says. */

import { useEffect, useRef, useState } from "preact/hooks";
import { get } from "./client";
import { paced } from "./pace";

export interface Asked<T> {
  value: T | undefined;
  error: Error | undefined;
  /** Asks again at once. */
  again: () => void;
}

/**
 * @param path from the API's root; null to ask nothing yet.
 * @param everyMs how long to wait before asking again; a function may go by the value, and end it with null.
 */
export function useAsked<T>(path: string | null, everyMs: (value: T) => number | null = () => null): Asked<T> {
  const [state, setState] = useState<{ path: string | null; value?: T; error?: Error }>({ path });
  const [turn, setTurn] = useState(0);
  const pace = useRef(everyMs);
  pace.current = everyMs;
  useEffect(() => {
    if (path === null) return;
    const left = new AbortController();
    let timer: ReturnType<typeof setTimeout>;
    const ask = async () => {
      let wait: number | null = null;
      const began = performance.now();
      try {
        const value = await get<T>(path, left.signal);
        setState({ path, value });
        wait = pace.current(value);
        if (wait !== null) wait = paced(wait, performance.now() - began);
      } catch (error) {
        if (left.signal.aborted) return;
        setState((before) => ({ path, value: before.path === path ? before.value : undefined, error: error as Error }));
        if (error instanceof TypeError) wait = 2000; // nobody answers: until somebody does
      }
      if (wait !== null && !left.signal.aborted) timer = setTimeout(ask, wait);
    };
    ask();
    return () => {
      left.abort();
      clearTimeout(timer);
    };
  }, [path, turn]);
  const current = state.path === path; // what was asked before is not shown for what is asked now
  return {
    value: current ? state.value : undefined,
    error: current ? state.error : undefined,
    again: () => setTurn((n) => n + 1),
  };
}
