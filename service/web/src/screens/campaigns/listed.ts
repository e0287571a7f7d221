/** The campaigns of the list: as many pages as are wanted, and up to date while one of them is at work. */

import { useState } from "preact/hooks";
import { get } from "../../api/client";
import type { Asked } from "../../api/asked";
import { ended } from "../../api/ended";
import { usePolled } from "../../api/polled";
import type { Body } from "../../api/types";

export type Listed = Body<"CampaignSummary">;

const AGAIN_MS = 2000;

interface List {
  items: Listed[];
  /** Whether there are older ones. */
  more: boolean;
}

/**
 * @param filters the API's own query parameters.
 * @param pages how many pages to show; each round asks from the newest on, so that what is posted meanwhile neither
 *   repeats nor hides anything.
 */
export function useListed(filters: Record<string, string>, pages: number): Asked<List> {
  const asked = new URLSearchParams(filters).toString();
  const [state, setState] = useState<{ asked: string; value?: List; error?: Error }>({ asked });
  const again = usePolled(`${asked} ${pages}`, async (left) => {
    try {
      const value = await pagesOf(filters, pages, left);
      setState({ asked, value });
      return value.items.every(ended) ? "seen" : AGAIN_MS;
    } catch (error) {
      if (left.aborted) return null;
      setState((before) => ({ asked, value: before.asked === asked ? before.value : undefined, error: error as Error }));
      return error instanceof TypeError ? AGAIN_MS : "seen";
    }
  });
  const current = state.asked === asked;
  return { value: current ? state.value : undefined, error: current ? state.error : undefined, again };
}

async function pagesOf(filters: Record<string, string>, pages: number, left: AbortSignal): Promise<List> {
  const items: Listed[] = [];
  let cursor: string | null = null;
  for (let page = 0; page < pages; page++) {
    const query = new URLSearchParams({ ...filters, limit: "50", ...(cursor === null ? {} : { cursor }) });
    const body: Body<"CampaignPage"> = await get(`v1/campaigns?${query}`, left);
    items.push(...body.items);
    cursor = body.next;
    if (cursor === null) break;
  }
  return { items, more: cursor !== null };
}
