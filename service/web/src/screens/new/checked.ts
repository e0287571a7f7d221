/** What the service would say of a spec, asked while it is written. */

import { useEffect, useState } from "preact/hooks";
import { Problem, send } from "../../api/client";
import type { Body } from "../../api/types";
import type { Wrong } from "./form";

/** How it stands: `silent` where nothing is known, as with a service that cannot check or does not answer. */
export type Verdict =
  | { state: "silent" | "asking" }
  | { state: "good"; adjustments: readonly Body<"Adjustment">[]; power: Body<"Power"> }
  | { state: "wrong"; wrong: readonly Wrong[]; why: string };

const PAUSE_MS = 350; // after the last key

let able = true; // until the service says that it cannot

export function useChecked(body: string | null): Verdict {
  const [verdict, setVerdict] = useState<Verdict>({ state: "silent" });
  useEffect(() => {
    if (body === null || !able) return;
    let left = false;
    setVerdict((before) => (before.state === "wrong" ? before : { state: "asking" })); // a fault stays until it is known to be mended
    const timer = setTimeout(async () => {
      const found = await check(body);
      if (!left) setVerdict(found);
    }, PAUSE_MS);
    return () => {
      left = true;
      clearTimeout(timer);
    };
  }, [body]);
  return verdict;
}

async function check(body: string): Promise<Verdict> {
  try {
    const { adjustments, power } = (await send<Body<"CampaignCheck">>("POST", "v1/campaigns/check", JSON.parse(body)))!;
    return { state: "good", adjustments, power };
  } catch (error) {
    if (!(error instanceof Problem)) return { state: "silent" };
    if (error.status === 404 || error.status === 405) able = false;
    return error.status === 422 ? { state: "wrong", wrong: error.errors, why: error.message } : { state: "silent" };
  }
}
