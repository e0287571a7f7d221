/** Efforts of a campaign: by which methods, with how many seeds and episodes. Pure. */

import type { Body } from "../../api/types";
import type { Values } from "./schema";
import type { TimeOf } from "./times";

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

export const FIRST = "mixed"; // scenario of a form that names none; in low a sound ego fails in minor contacts only
const START_S = 6; // of a run
const FIND_MOST = ["risk-sac-diverse", "archive"] as const;

export const EFFORTS: readonly Effort[] = [
  { title: "Quick look", about: "Is there anything at all?", methods: FIND_MOST, seeds: [0], seconds: null, most: 60 },
  { title: "An hour", about: "Which kinds of failures are there?", methods: FIND_MOST, seeds: [0, 1], seconds: 3600, most: 10_000 },
  { title: "Overnight", about: "What is left, with a control to compare with?", methods: [...FIND_MOST, "random"], seeds: [0, 1, 2, 3], seconds: 8 * 3600, most: 30_000 },
];

/**
 * Sets methods, seeds and budget of a spec.
 *
 * @param scenarios what is searched; of each place of a map the scenario that it is most like.
 */
export function applied({ methods, seeds, seconds, most }: Effort, spec: Values, scenarios: readonly string[], time: TimeOf): Values {
  const searched = scenarios.length ? scenarios : [FIRST];
  const round_s = seeds.length * roundOf(searched, methods, time);
  const starts_s = START_S * searched.length * seeds.length * methods.length;
  const episodes = seconds === null ? most : Math.max(60, Math.min(most, 100 * Math.floor((seconds - starts_s) / round_s / 100)));
  const budget = { ...(spec.budget as Values), episodes, evaluation_episodes: 0 };
  return { ...spec, methods: [...methods], seeds: [...seeds], budget };
}

/** Whether a spec is what an effort made of it. */
export function isOf(effort: Effort, spec: Values, scenarios: readonly string[], time: TimeOf): boolean {
  const mine = ["methods", "seeds", "budget"] as const;
  const made = applied(effort, spec, scenarios, time);
  return mine.every((name) => JSON.stringify(made[name]) === JSON.stringify(spec[name]));
}

export interface Cost {
  runs: number;
  episodes: number;
  /** Time of a slot. */
  seconds: number;
}

const TRAFFICS = 2; // of an i.i.d. phase: undisturbed, and with random adversaries

/** Runs, episodes and processor time of a campaign. */
export function costOf(spec: Values, scenarios: readonly string[], time: TimeOf): Cost {
  const methods = spec.methods as string[];
  const budget = spec.budget as { episodes: number | null; evaluation_episodes: number | null };
  const iid = spec.iid as { episodes: number | null } | null | undefined;
  const each = (budget.episodes ?? 0) + (budget.evaluation_episodes ?? 0);
  const seeds = (spec.seeds as unknown[]).length;
  const searches = scenarios.length * seeds;
  const drawn = iid ? scenarios.length * TRAFFICS : 0;
  const ofDrawn = drawn * (iid?.episodes ?? 0);
  const rounds = searches * each;
  const runs = searches * methods.length + drawn;
  return {
    runs,
    episodes: rounds * methods.length + ofDrawn,
    seconds: START_S * runs + seeds * each * roundOf(scenarios, methods, time) + TRAFFICS * (iid?.episodes ?? 0) * roundOf(scenarios, ["random"], time),
  };
}

/** Time of one episode of each method in each scenario, s. */
function roundOf(scenarios: readonly string[], methods: readonly string[], time: TimeOf): number {
  return sum(scenarios.flatMap((scenario) => methods.map((method) => time(scenario, method).seconds)));
}

function sum(values: readonly number[]): number {
  return values.reduce((total, each) => total + each, 0);
}
