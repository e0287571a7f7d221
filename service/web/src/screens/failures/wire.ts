/** Bodies of the API that `openapi.yaml` does not have yet. */

export type TriageState = "new" | "confirmed" | "dismissed" | "fixed";
export type Grade = "careful" | "ideal" | "unavoidable";
type Column<T> = T[];
type Measure = Column<number | null>;

/** All failures of a campaign by columns, each with an entry per failure in order of arrival. */
export interface FailureTable {
  ids: Column<string>;
  run_ids: Column<string>;
  families: Column<string>;
  methods: Column<string>;
  seeds: Column<number>;
  indices: Column<number>;
  phases: Column<string>;
  valid: Column<boolean>;
  grade: Column<Grade | null>;
  distinct: Column<boolean>;
  kind: Column<number>;
  striker: Column<string>;
  striker_kind: Column<string>;
  conflict_type: Column<string | null>;
  conflict_s: Measure;
  time_s: Measure;
  visible_for_s: Measure;
  ego_speed_mps: Measure;
  other_speed_mps: Measure;
  relative_speed_mps: Measure;
  lateral_offset_m: Measure;
  min_ttc_s: Measure;
  min_rss_margin_m: Measure;
  min_robustness: Measure;
  ego_peak_braking_mps2: Measure;
  hidden: Column<boolean | null>;
  ego_response: Column<string | null>;
  ground: Column<string | null>;
  broke: Column<string[]>;
  refused_by: Column<string[]>;
  repeats: Column<"verified" | "flaky" | null>;
  triage: Column<TriageState>;
  kinds: Kind[];
  scenes: Record<string, Scenes>;
}

export interface Kind {
  signature: string;
  name: string;
  failures: number;
  distinct: number;
  preventable: number;
}

/** The scenes of one family: a row of parameters per failure, and the failure's place in the columns. */
export interface Scenes {
  names: string[];
  rows: number[][];
  of: number[];
}

export interface Triage {
  state: TriageState;
  comment: string;
  changed_at?: string;
}
