/** What a component asks of the API: loading, then there or refused; asked again as often as it says. */

import { useState } from "preact/hooks";
import { get } from "./client";
import { usePolled } from "./polled";

const LOST_MS = 2000; // while the service does not answer

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
  const again = usePolled(path, async (left) => {
    try {
      const value = await get<T>(path!, left);
      setState({ path, value });
      return everyMs(value);
    } catch (error) {
      if (left.aborted) return null;
      setState((before) => ({ path, value: before.path === path ? before.value : undefined, error: error as Error }));
      return error instanceof TypeError ? LOST_MS : null;
    }
  });
  const current = state.path === path; // what was asked before is not shown for what is asked now
  return { value: current ? state.value : undefined, error: current ? state.error : undefined, again };
}
