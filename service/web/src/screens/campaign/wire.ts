/** Bodies of calls that `openapi.yaml` will have. */

import type { Body } from "../../api/types";

export interface Curve {
  run_id: string;
  family: string;
  method: string;
  seed: number;
  state: Body<"Run">["state"];
  /** 1-based counts of the search. */
  episodes: number[];
  window_ecr: (number | null)[];
  window_pcr: (number | null)[];
  distinct: (number | null)[];
  distinct_preventable: (number | null)[];
  dual_variable: (number | null)[];
  /** Of the episodes since the point before. */
  mean_cost: (number | null)[];
}

export interface Curves {
  runs: Curve[];
}
