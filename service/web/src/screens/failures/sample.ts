/** A table of failures for tests, each column by a rule, so that any of them can be reckoned by hand. */

import type { FailureTable } from "./wire";

export function sample(size: number, changed: Partial<FailureTable> = {}): FailureTable {
  const column = <T,>(of: (i: number) => T): T[] => Array.from({ length: size }, (_, i) => of(i));
  return {
    ids: column((i) => `low-random-1-search-${i}`),
    run_ids: column((i) => `low-random-${i % 2}`),
    families: column((i) => (i % 2 ? "mixed" : "low")),
    methods: column(() => "random"),
    seeds: column((i) => i),
    indices: column((i) => i),
    phases: column(() => "search"),
    valid: column((i) => i % 4 !== 3),
    requirement: column(() => "no_contact"),
    failed: column((i) => (i % 4 === 3 ? [] : ["no_contact"])),
    grade: column((i) => (i % 4 === 3 ? null : (["preventable", "full_braking", "unavoidable"] as const)[i % 3]!)),
    severity: column((i) => (["minor", "moderate", "severe"] as const)[i % 3]!),
    injury_risk: column(() => 0.1),
    fault: column((i) => (i % 4 === 3 ? null : (["ego", "shared", "other"] as const)[i % 3]!)),
    prevented_by: column((i) => (i % 3 === 0 ? ["r157", "full_braking"] : i % 3 === 1 ? ["full_braking"] : [])),
    headline: column(() => false),
    distinct: column((i) => i % 4 === 0),
    niche: column((i) => (i % 4 === 3 ? null : i % 8)),
    driven_by: column((i) => (["policy", "model", "script", "random", null] as const)[i % 5]!),
    kind: column((i) => i % 2),
    striker: column((i) => (i % 2 ? "pedestrian" : "left")),
    striker_kind: column((i) => (i % 2 ? "pedestrian" : "vehicle")),
    conflict_type: column(() => "cut_in"),
    conflict_s: column((i) => (i === 2 ? null : 1)),
    time_s: column((i) => 2 + i),
    visible_for_s: column(() => 1),
    ego_speed_mps: column(() => 10),
    other_speed_mps: column(() => 8),
    relative_speed_mps: column((i) => (i * 7) % 10),
    lateral_offset_m: column(() => 0),
    min_ttc_s: column(() => null),
    min_rss_margin_m: column(() => null),
    min_robustness: column(() => -0.1),
    ego_peak_braking_mps2: column(() => 4),
    hidden: column(() => false),
    ego_response: column(() => "braking"),
    ground: column(() => "lane"),
    broke: column((i) => (i % 5 ? [] : ["speeding"])),
    ego_broke: column(() => []),
    refused_by: column((i) => (i % 4 === 3 ? ["no_sideswipe", ...(i % 8 === 7 ? ["ego_moving"] : [])] : [])),
    repeats: column(() => null),
    triage: column(() => "new"),
    kinds: [
      { signature: "cut-in, ahead", requirement: "no_contact", name: "cut-in, ahead", failures: 0, distinct: 0, preventable: 0 },
      { signature: "pedestrian, from hiding", requirement: "no_contact", name: "pedestrian, from hiding", failures: 0, distinct: 0, preventable: 0 },
    ],
    scenes: {
      low: { names: ["friction"], rows: column((i) => [i / 10]).filter((_, i) => i % 2 === 0), of: column((i) => i).filter((i) => i % 2 === 0) },
    },
    ...changed,
  };
}
