/** The failures that were listed last, in their order: where "previous" and "next" lead from one of them. */

interface Listed {
  campaign: string;
  ids: string[];
  /** Of the list's address, so that one comes back to the same filters. */
  query: string;
}

let listed: Listed = { campaign: "", ids: [], query: "" };

export function keepListed(now: Listed): void {
  listed = now;
}

export function listedAround(campaign: string, id: string): { previous?: string; next?: string; query: string } {
  if (listed.campaign !== campaign) return { query: "" };
  const at = listed.ids.indexOf(id);
  return { previous: at < 0 ? undefined : listed.ids[at - 1], next: at < 0 ? undefined : listed.ids[at + 1], query: listed.query };
}
