/** Bodies of the API by the names that this screen has for them. */

import type { Body } from "../../api/types";

export type FailureTable = Body<"FailureTable">;
export type TriageState = FailureTable["triage"][number];
export type Grade = Body<"Grade">;

export type Triage = Body<"Triage">;
/** What a person says; the service adds when. */
export type Note = Pick<Triage, "state" | "comment">;
