/** Campaigns by ego, and the row of a trend that goes on to the newest of them. Pure. */

import type { Listed } from "../campaigns/listed";
import type { Point, Row } from "../trend/points";

export interface EgoCampaigns {
  /** Registered name, or SUMO's profile. */
  name: string;
  /** Newest first. */
  campaigns: Listed[];
}

/** Groups campaigns by ego; the ego with the newest campaign first. */
export function byEgo(campaigns: readonly Listed[]): EgoCampaigns[] {
  const groups = new Map<string, Listed[]>();
  for (const campaign of campaigns) {
    const name = campaign.ego.driver ?? campaign.ego.profile;
    groups.set(name, [...(groups.get(name) ?? []), campaign]);
  }
  return [...groups].map(([name, own]) => ({ name, campaigns: own }));
}

/** Returns the row with the newest of the campaigns; undefined if none of them has succeeded. */
export function newestRow(rows: readonly Row[], campaigns: readonly Pick<Listed, "id">[]): Row | undefined {
  const has = (row: Row, id: string) => row.points.some((point) => point.campaign_id === id || point.earlier.includes(id));
  for (const { id } of campaigns) {
    const row = rows.find((each) => has(each, id));
    if (row) return row;
  }
  return rows[0];
}

/** Length of each version's bar, in per cent of the longest; null where the headline is unknown. */
export function bars(points: readonly Pick<Point, "headline">[]): (number | null)[] {
  const most = Math.max(1, ...points.map(({ headline }) => headline ?? 0));
  return points.map(({ headline }) => (headline === null ? null : (100 * headline) / most));
}
