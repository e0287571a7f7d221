/** Efforts of a campaign: by which methods, with how many seeds and episodes. Pure. */

import type { Body } from "../../api/types";
import type { Values } from "./schema";

type Spec = Body<"CampaignSpec">;

export interface Effort {
  title: string;
  about: string;
  methods: readonly (Spec["methods"] & object)[number][];
  seeds: readonly number[];
  /** Processor time of the whole campaign, s; null: as many episodes as `most`. */
  seconds: number | null;
  /** Episodes of a run, at most. */
  most: number;
}

/** Processor time of an episode of `random`, s, and of a run's start: 0.07 in `low`, 0.09 in `mixed`, but 0.35 in `dense`. */
const RANDOM_EPISODE_S = 0.1;
const START_S = 6;
const FIND_MOST = ["risk-sac-diverse", "archive"] as const;

export const EFFORTS: readonly Effort[] = [
  { title: "Quick look", about: "Is there anything at all?", methods: FIND_MOST, seeds: [0], seconds: null, most: 60 },
  { title: "An hour", about: "Which kinds of failures are there?", methods: FIND_MOST, seeds: [0, 1], seconds: 3600, most: 10_000 },
  { title: "Overnight", about: "What is left, with a control to compare with?", methods: [...FIND_MOST, "random"], seeds: [0, 1, 2, 3], seconds: 8 * 3600, most: 30_000 },
];

/** Method → processor time of an episode as a multiple of one of `random`. */
export type EpisodeCosts = Readonly<Record<string, number | null>>;

/**
 * Sets methods, seeds and budget of a spec.
 *
 * @param families how many scenarios or places are searched.
 */
export function applied({ methods, seeds, seconds, most }: Effort, spec: Values, families: number, costs: EpisodeCosts): Values {
  const round_s = Math.max(1, families) * seeds.length * RANDOM_EPISODE_S * sum(methods.map((name) => costs[name] ?? 1));
  const starts_s = START_S * Math.max(1, families) * seeds.length * methods.length;
  const episodes = seconds === null ? most : Math.max(60, Math.min(most, 100 * Math.floor((seconds - starts_s) / round_s / 100)));
  const budget = { ...(spec.budget as Values), episodes, evaluation_episodes: 0 };
  return { ...spec, methods: [...methods], seeds: [...seeds], budget };
}

/** Whether a spec is what an effort made of it. */
export function isOf(effort: Effort, spec: Values, families: number, costs: EpisodeCosts): boolean {
  const mine = ["methods", "seeds", "budget"] as const;
  const made = applied(effort, spec, families, costs);
  return mine.every((name) => JSON.stringify(made[name]) === JSON.stringify(spec[name]));
}

export interface Cost {
  runs: number;
  episodes: number;
  /** Processor time, by the measured time of an episode of each method. */
  seconds: number;
}

const TRAFFICS = 2; // of an i.i.d. phase: undisturbed, and with random adversaries

/** Runs, episodes and processor time of a campaign. */
export function costOf(spec: Values, families: number, costs: EpisodeCosts): Cost {
  const methods = spec.methods as string[];
  const budget = spec.budget as { episodes: number | null; evaluation_episodes: number | null };
  const iid = spec.iid as { episodes: number | null } | null | undefined;
  const each = (budget.episodes ?? 0) + (budget.evaluation_episodes ?? 0);
  const searches = families * (spec.seeds as unknown[]).length;
  const drawn = iid ? families * TRAFFICS : 0;
  const ofDrawn = drawn * (iid?.episodes ?? 0);
  const rounds = searches * each;
  const runs = searches * methods.length + drawn;
  return {
    runs,
    episodes: rounds * methods.length + ofDrawn,
    seconds: START_S * runs + RANDOM_EPISODE_S * (rounds * sum(methods.map((name) => costs[name] ?? 1)) + ofDrawn),
  };
}

function sum(values: readonly number[]): number {
  return values.reduce((total, each) => total + each, 0);
}
