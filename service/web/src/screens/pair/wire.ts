/** Bodies of the API that its description does not have yet. */

import type { Body } from "../../api/types";

export interface TwinPlay {
  twin: string;
  /** In words. */
  outcome: string;
  collision: Body<"Collision"> | null;
  series: Body<"Series">;
}
