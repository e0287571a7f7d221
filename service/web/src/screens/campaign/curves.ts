/** Curves that grow with the events of a search, and stay as long as a screen is wide. */

import type { Body } from "../../api/types";
import type { ServerEvent } from "../../api/events";
import { isValid } from "../../ui/violations";
import type { DrivenBy } from "../../ui/driven";
import { drive, drivenAt, type Driven } from "./driven";

export const WINDOW = 100; // episodes of a sliding rate, as in the API
export const POINTS = 200; // of a curve, about

/** What a curve shows of one episode; null where it is not known. */
export interface Point {
  episodes: number;
  window_ecr: number | null;
  window_pcr: number | null;
  distinct: number | null;
  distinct_preventable: number | null;
  dual_variable: number | null;
  mean_cost: number | null;
  driven_by: DrivenBy | null;
}

type Column = Exclude<keyof Point, "episodes" | "driven_by">;
type Run = Pick<Body<"RunCurves">, "run_id" | "family" | "method" | "seed" | "state">;

/** A run's curve as the API gives it, or longer by what its events said. */
export type Curve = Run & { episodes: number[]; driven_by: Driven } & Record<Column, (number | null)[]>;

const KEPT: Column[] = ["window_ecr", "window_pcr", "distinct", "distinct_preventable", "dual_variable"];

/** The share of valid and of preventable contacts among a run's newest episodes, once all of those are known. */
export class Sliding {
  private newest: { valid: boolean; preventable: boolean }[] = [];
  private last = 0; // how many episodes the search had with the newest of them

  add(episodes: number, valid: boolean, preventable: boolean): void {
    if (episodes <= this.last) return; // told again
    if (episodes !== this.last + 1) this.newest = []; // some are missing in between
    this.newest.push({ valid, preventable });
    if (this.newest.length > WINDOW) this.newest.shift();
    this.last = episodes;
  }

  rate(of: "valid" | "preventable"): number | null {
    const whole = this.newest.length === Math.min(WINDOW, this.last);
    return whole && this.last ? this.newest.filter((each) => each[of]).length / this.newest.length : null;
  }
}

/**
 * A curve with one more episode, in place. The newest point moves along until it is as far from the one before as the
 * points of a snapshot would be, so that a long search does not make a long curve.
 */
export function extend(curve: Curve, point: Point): void {
  const end = curve.episodes.length - 1;
  const newest = curve.episodes[end] ?? 0;
  if (point.episodes <= newest) return;
  const before = curve.episodes[end - 1] ?? 0;
  const room = end >= 0 && point.episodes - before <= Math.floor(point.episodes / POINTS);
  const at = room ? end : end + 1;
  curve.mean_cost[at] = room ? joined(curve.mean_cost[end]!, newest - before, point.mean_cost, point.episodes - newest) : point.mean_cost;
  curve.episodes[at] = point.episodes;
  for (const name of KEPT) curve[name][at] = point[name];
  drive(curve.driven_by, at, point.driven_by);
  if (curve.episodes.length > 2 * POINTS) halve(curve);
}

/** Every other point is left out, never the newest; the costs of what is left out go on to the next. */
export function halve(curve: Curve): void {
  const { episodes, mean_cost } = curve;
  const kept = episodes.map((_, at) => at).filter((at) => (episodes.length - 1 - at) % 2 === 0);
  const costs = kept.map((at) => {
    const [start, middle, end] = [episodes[at - 2] ?? 0, episodes[at - 1] ?? 0, episodes[at]!];
    return joined(mean_cost[at - 1] ?? null, middle - start, mean_cost[at]!, end - middle);
  });
  for (const name of KEPT) curve[name] = kept.map((at) => curve[name][at]!);
  curve.mean_cost = costs;
  curve.driven_by = drivenAt(curve.driven_by, kept);
  curve.episodes = kept.map((at) => episodes[at]!);
}

/**
 * The mean of two means over so many episodes each; null counts for nothing. The API weighs by steps, which a curve does
 * not have: on a screen there is no telling them apart, and the next snapshot has it as it is.
 */
function joined(first: number | null, firsts: number, second: number | null, seconds: number): number | null {
  if (first === null || !firsts) return second;
  if (second === null || !seconds) return first;
  return (first * firsts + second * seconds) / (firsts + seconds);
}

/** The mean over about the last so many episodes at each point, of means over the episodes since the point before. */
export function trailing(episodes: number[], means: (number | null)[], over: number): (number | null)[] {
  let [first, sum, weight] = [0, 0, 0];
  const span = (at: number) => (means[at] === null ? 0 : episodes[at]! - (episodes[at - 1] ?? 0));
  return episodes.map((end, at) => {
    sum += (means[at] ?? 0) * span(at);
    weight += span(at);
    for (; first < at && episodes[first]! <= end - over; first++) {
      sum -= (means[first] ?? 0) * span(first);
      weight -= span(first);
    }
    return weight ? sum / weight : null;
  });
}

/** All curves of a campaign: a snapshot, and what its stream of events says after it. */
export class LiveCurves {
  private sliding = new Map<string, Sliding>();
  private byRun: Map<string, Curve>;

  constructor(readonly runs: Curve[]) {
    this.byRun = new Map(runs.map((curve) => [curve.run_id, curve]));
  }

  /** Events of before the snapshot are welcome: sliding rates go on from them. */
  apply(events: ServerEvent[]): void {
    for (const { event, data } of events) {
      if (event === "state") continue;
      const episode: Body<"Episode"> = JSON.parse(data);
      if (episode.phase === "search") this.add(episode);
    }
  }

  private add(episode: Body<"Episode">): void {
    const curve = this.byRun.get(episode.run_id);
    if (!curve) return;
    const sliding = this.sliding.get(curve.run_id) ?? new Sliding();
    this.sliding.set(curve.run_id, sliding);
    const valid = episode.outcome === "failure" && episode.collision !== null && isValid(episode.collision);
    const episodes = episode.index + 1;
    sliding.add(episodes, valid, valid && episode.collision?.judgement?.grade === "preventable");
    extend(curve, {
      episodes,
      window_ecr: sliding.rate("valid"),
      window_pcr: sliding.rate("preventable"),
      distinct: episode.funnel?.distinct ?? null,
      distinct_preventable: episode.funnel?.preventable ?? null,
      dual_variable: episode.dual_variable,
      driven_by: episode.driven_by,
      mean_cost: episode.steps ? episode.mean_cost : null,
    });
  }
}
