/** A campaign's ECR as a line that fits a cell of the table. */

import type { Body } from "../../api/types";

type Curve = Pick<Body<"RunCurves">, "episodes" | "window_ecr">;

export interface Spark {
  /** Share of the episodes, from 0 to 1. */
  x: number[];
  /** Mean over the runs that had an ECR there. */
  mean: number[];
}

/** The mean over runs whose episodes need not be the same: each is read at its newest point not later than that share. */
export function spark(runs: readonly Curve[], points: number): Spark {
  const longest = Math.max(0, ...runs.map((run) => run.episodes.at(-1) ?? 0));
  const x: number[] = [];
  const mean: number[] = [];
  if (longest === 0) return { x, mean };
  for (let point = 1; point <= points; point++) {
    const episode = (longest * point) / points;
    const values = runs.map((run) => at(run, episode)).filter((value) => value !== null);
    if (values.length === 0) continue;
    x.push(point / points);
    mean.push(values.reduce((sum, value) => sum + value, 0) / values.length);
  }
  return { x, mean };
}

function at(run: Curve, episode: number): number | null {
  let found: number | null = null;
  for (let i = 0; i < run.episodes.length && run.episodes[i]! <= episode; i++) found = run.window_ecr[i]!;
  return found;
}

/** The line as an SVG path; the largest value, but at least `least`, reaches the top. */
export function path({ x, mean }: Spark, width: number, height: number, least: number): string {
  const top = Math.max(least, ...mean);
  const points = x.map((share, i) => `${(share * width).toFixed(1)} ${(height * (1 - mean[i]! / top)).toFixed(1)}`);
  return points.length ? `M${points.join("L")}` : "";
}
