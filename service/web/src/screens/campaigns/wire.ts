/** `GET …/curves`, until the API's description has it. */

export interface Curve {
  run_id: string;
  method: string;
  episodes: number[];
  window_ecr: (number | null)[];
}

export interface Curves {
  runs: Curve[];
}
