/** The order of the list: by a column, either way, as the address says it: `distinct`, or `-distinct` for the largest first. */

import { egoWords } from "../../ui/text";
import type { Listed } from "./listed";

type Value = number | string | null;

/** What each column that can be sorted by goes by; null stands last, whichever way. */
export const KEYS = {
  label: (campaign: Listed) => (campaign.label || campaign.id).toLowerCase(),
  state: (campaign: Listed) => campaign.state,
  families: (campaign: Listed) => campaign.families.join(),
  methods: (campaign: Listed) => campaign.methods.join(),
  ego: (campaign: Listed) => egoWords(campaign.ego),
  progress: ({ progress }: Listed) => progress.episodes_done / Math.max(1, progress.episodes_total),
  ecr: ({ progress }: Listed) => progress.window_ecr,
  headline: ({ progress }: Listed) => progress.headline,
  distinct: ({ progress }: Listed) => progress.distinct_failures,
  preventable: ({ progress }: Listed) => progress.distinct_preventable,
  eta: ({ progress }: Listed) => progress.eta_s,
  created: (campaign: Listed) => campaign.created_at,
} satisfies Record<string, (campaign: Listed) => Value>;

export type Column = keyof typeof KEYS;

export interface Order {
  column: Column;
  descending: boolean;
}

const NEWEST_FIRST: Order = { column: "created", descending: true };
const WORDS: readonly Column[] = ["label", "state", "families", "methods", "ego"];

export function orderOf(text: string | null): Order {
  const column = (text ?? "").replace(/^-/, "");
  if (!Object.hasOwn(KEYS, column)) return NEWEST_FIRST;
  return { column: column as Column, descending: text!.startsWith("-") };
}

/** As the address says it; undefined for the order that needs no word. */
export function textOf({ column, descending }: Order): string | undefined {
  if (column === NEWEST_FIRST.column && descending) return undefined;
  return descending ? `-${column}` : column;
}

/** After a click on a column's head: words from A on, numbers from the largest on, and the other way at the second click. */
export function clicked(order: Order, column: Column): Order {
  if (order.column === column) return { column, descending: !order.descending };
  return { column, descending: !WORDS.includes(column) };
}

export function sorted(campaigns: readonly Listed[], { column, descending }: Order): Listed[] {
  const key: (campaign: Listed) => Value = KEYS[column];
  return [...campaigns].sort((a, b) => {
    const [one, other] = [key(a), key(b)];
    if (one === null || other === null) return Number(one === null) - Number(other === null);
    const sign = one < other ? -1 : one > other ? 1 : 0;
    return descending ? -sign : sign;
  });
}
