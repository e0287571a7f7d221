/** Whether the server answers, on every screen: also where nothing else is asked for any more. */

import { useEffect } from "preact/hooks";
import { call, connected } from "./client";

const EVERY_MS = 2000;
const PATIENCE_MS = 2500; // together less than the five seconds within which the banner shows

/** Asks for the server's health again and again, but not while the tab is hidden. */
export function useAlive(): void {
  useEffect(() => {
    let timer: ReturnType<typeof setTimeout>;
    let left = false;
    const round = async () => {
      clearTimeout(timer);
      if (!document.hidden) await answers();
      if (!left) timer = setTimeout(round, EVERY_MS);
    };
    const seen = () => void (document.hidden || round());
    document.addEventListener("visibilitychange", seen);
    round();
    return () => {
      left = true;
      clearTimeout(timer);
      document.removeEventListener("visibilitychange", seen);
    };
  }, []);
}

async function answers(): Promise<void> {
  const patience = AbortSignal.timeout(PATIENCE_MS);
  try {
    await (await call("healthz", { signal: patience })).text(); // read, or the connection stays busy
  } catch {
    if (patience.aborted) connected.set(false); // any other failure is an answer, or `call` has noted it
  }
}
