/** The table out of the pages of failures, until the service has `failure-table`. */

import { useEffect, useState } from "preact/hooks";
import type { Asked } from "../../api/asked";
import { get } from "../../api/client";
import type { FailureTable, Grade, Kind } from "./wire";

export async function tableOf(campaign: string, signal: AbortSignal): Promise<FailureTable> {
  const path = `v1/campaigns/${encodeURIComponent(campaign)}`;
  const { runs } = await get<any>(path, signal);
  const items: any[] = [];
  let cursor: string | null = "";
  while (cursor !== null) {
    const page: any = await get<any>(`${path}/failures?tier=raw&limit=500${cursor && `&cursor=${cursor}`}`, signal);
    items.push(...page.items);
    cursor = page.next;
  }
  const run = new Map<string, any>(runs.map((each: any) => [each.id, each]));
  const signature = (e: any): string => e.collision.judgement?.signature ?? `unjudged ${e.collision.other_kind}`;
  const kinds: Kind[] = [...new Set(items.map(signature))].map((name) => ({ signature: name, name, failures: 0, distinct: 0, preventable: 0 }));
  const scenes: FailureTable["scenes"] = {};
  const seen = new Map<string, number>();
  const of = (name: string) => items.map((e) => e.collision[name]);
  const judged = (name: string) => items.map((e) => e.collision.judgement?.[name] ?? null);
  items.forEach((e, i) => {
    const family = run.get(e.run_id).family;
    const scene = (scenes[family] ??= { names: Object.keys(e.scene), rows: [], of: [] });
    scene.rows.push(scene.names.map((name) => e.scene[name]));
    scene.of.push(i);
  });
  return {
    ids: items.map((e) => e.id),
    run_ids: items.map((e) => e.run_id),
    families: items.map((e) => run.get(e.run_id).family),
    methods: items.map((e) => run.get(e.run_id).method),
    seeds: items.map((e) => e.seed),
    indices: items.map((e) => e.index),
    phases: items.map((e) => e.phase),
    valid: items.map((e) => e.outcome === "failure"),
    grade: judged("grade") as (Grade | null)[],
    distinct: items.map((e) => {
      const before = seen.get(e.run_id) ?? 0;
      seen.set(e.run_id, Math.max(before, e.funnel?.distinct ?? 0));
      return e.outcome === "failure" && (e.funnel?.distinct ?? 0) > before;
    }),
    kind: items.map((e) => kinds.findIndex((kind) => kind.name === signature(e))),
    striker: of("other_id"),
    striker_kind: of("other_kind"),
    conflict_type: judged("conflict_type"),
    conflict_s: judged("conflict_s"),
    time_s: of("time_s"),
    visible_for_s: of("visible_for_s"),
    ego_speed_mps: of("ego_speed_mps"),
    other_speed_mps: of("other_speed_mps"),
    relative_speed_mps: of("relative_speed_mps"),
    lateral_offset_m: of("lateral_offset_m"),
    min_ttc_s: of("early_min_ttc_s"),
    min_rss_margin_m: of("min_rss_margin_m"),
    min_robustness: of("early_min_robustness"),
    ego_peak_braking_mps2: of("ego_peak_braking_mps2"),
    hidden: judged("hidden"),
    ego_response: judged("ego_response"),
    ground: judged("ground"),
    broke: items.map((e) => e.collision.judgement?.broke ?? []),
    refused_by: items.map((e) => Object.keys(e.collision.verdicts).filter((rule) => !e.collision.verdicts[rule])),
    repeats: items.map((e) => (e.repetition === null ? null : e.repetition.same === e.repetition.times ? "verified" : "flaky")),
    triage: items.map(() => "new"),
    kinds,
    scenes,
  };
}

export function useTable(campaign: string): Asked<FailureTable> {
  const [value, setValue] = useState<FailureTable>();
  useEffect(() => {
    const signal = new AbortController().signal;
    get<FailureTable>(`v1/campaigns/${campaign}/failure-table?tier=raw`, signal)
      .catch(() => tableOf(campaign, signal))
      .then(setValue);
  }, []);
  return { value, error: undefined, again: () => {} };
}
