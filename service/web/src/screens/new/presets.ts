/** Campaigns to begin with: what is searched, by what and for how long; all else stays as it is in the form. */

import type { Body } from "../../api/types";
import type { Values } from "./schema";

type Spec = Body<"CampaignSpec">;

interface Preset {
  title: string;
  about: string;
  families: Spec["families"];
  methods: Spec["methods"] & object;
  seeds: number[];
  episodes: number;
  evaluation: number;
}

export const PRESETS: readonly Preset[] = [
  {
    title: "Quick look",
    about: "one road, a minute or so: is there anything at all?",
    families: ["low"],
    methods: ["archive", "random"],
    seeds: [0],
    episodes: 60,
    evaluation: 0,
  },
  {
    title: "Nightly",
    about: "everything, by the two methods that find most",
    families: ["low", "mixed", "dense"],
    methods: ["risk-sac-diverse", "archive"],
    seeds: [0],
    episodes: 1000,
    evaluation: 0,
  },
  {
    title: "Compare methods",
    about: "learners and controls on one family, three seeds each",
    families: ["mixed"],
    methods: ["risk-sac", "risk-sac-diverse", "sac-lag", "archive", "bo-only", "random"],
    seeds: [0, 1, 2],
    episodes: 500,
    evaluation: 0,
  },
  {
    title: "Full",
    about: "the paper's comparison and its ablations: days, not hours",
    families: ["low", "mixed", "dense"],
    methods: [
      "risk-sac",
      "risk-sac-diverse",
      "risk-sac-only-rper",
      "risk-sac-only-rs",
      "sac-lag",
      "sac",
      "ddpg-lag",
      "ddpg",
      "archive",
      "bo-only",
      "random",
      "no-adversary",
    ],
    seeds: [0, 1, 2, 3, 4],
    episodes: 2000,
    evaluation: 100,
  },
];

export function applied(preset: Preset, spec: Values): Values {
  const budget = { ...(spec.budget as Values), episodes: preset.episodes, evaluation_episodes: preset.evaluation };
  return { ...spec, families: [...preset.families], methods: [...preset.methods], seeds: [...preset.seeds], budget };
}

/** Whether a spec is what a preset made of it. */
export function isOf(preset: Preset, spec: Values): boolean {
  const mine = ["families", "methods", "seeds", "budget"] as const;
  const made = applied(preset, spec);
  return mine.every((name) => JSON.stringify(made[name]) === JSON.stringify(spec[name]));
}

export interface Cost {
  runs: number;
  episodes: number;
}

const TRAFFICS = 2; // of an i.i.d. phase: undisturbed, and with random adversaries

/** What a campaign costs: runs, and episodes in all of them. */
export function costOf(spec: Values, families = (spec.families as unknown[]).length): Cost {
  const length = (name: string) => (spec[name] as unknown[]).length;
  const budget = spec.budget as { episodes: number | null; evaluation_episodes: number | null };
  const iid = spec.iid as { episodes: number | null } | null | undefined;
  const searches = families * length("methods") * length("seeds");
  const drawn = iid ? families * TRAFFICS : 0;
  const episodes = searches * ((budget.episodes ?? 0) + (budget.evaluation_episodes ?? 0)) + drawn * (iid?.episodes ?? 0);
  return { runs: searches + drawn, episodes };
}
