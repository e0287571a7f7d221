/** Small pictures on cards: requested once a card stays in view, and kept for its return. */

import { useEffect, useState } from "preact/hooks";
import { call, Problem } from "../api/client";
import type { Turn } from "../api/turn";

const KEPT = 400;
const STAYS_MS = 90; // cards that only fly by are not asked for
const AGAIN_MS = 2000;
const kept = new Map<string, string>(); // path -> blob URL, the one used last at the end

/**
 * The picture's address; null while it loads, empty where there is none.
 *
 * @param turn delays the request, where the service draws few pictures at once.
 */
export function useThumbnail(path: string, turn: Turn = (act) => act()): string | null {
  const [state, setState] = useState<{ path: string; url: string | null }>({ path, url: used(path) });
  useEffect(() => {
    const there = used(path);
    setState({ path, url: there });
    if (there !== null) return;
    const left = new AbortController();
    let timer: ReturnType<typeof setTimeout>;
    const ask = async () => {
      try {
        const picture = await turn(async () => (await call(path, { signal: left.signal })).blob());
        if (!left.signal.aborted) setState({ path, url: keep(path, URL.createObjectURL(picture)) });
      } catch (error) {
        if (left.signal.aborted) return;
        const lasting = error instanceof Problem && error.status < 500 && error.status !== 429;
        if (lasting) setState({ path, url: "" });
        else timer = setTimeout(ask, AGAIN_MS);
      }
    };
    timer = setTimeout(ask, STAYS_MS);
    return () => {
      left.abort();
      clearTimeout(timer);
    };
  }, [path]);
  return state.path === path ? state.url : null;
}

function used(path: string): string | null {
  const url = kept.get(path);
  if (url === undefined) return null;
  kept.delete(path);
  kept.set(path, url);
  return url;
}

function keep(path: string, url: string): string {
  kept.set(path, url);
  if (kept.size > KEPT) {
    const [oldest, gone] = kept.entries().next().value!;
    kept.delete(oldest);
    URL.revokeObjectURL(gone);
  }
  return url;
}
