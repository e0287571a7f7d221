/** Bodies of the API by the names that this screen has for them. */

import type { Body } from "../../api/types";

export type FailureTable = Body<"FailureTable">;
export type TriageState = FailureTable["triage"][number];
export type Grade = Body<"Grade">;

/** Not in `openapi.yaml` yet. */
export interface Triage {
  state: TriageState;
  comment: string;
  changed_at?: string;
}
