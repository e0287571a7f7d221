/** How long an episode takes a slot, by scenario and method: measured by runs of this server, or estimated. Pure. */

import type { Body } from "../../api/types";
import type { Pattern } from "../maps/places";

type Scenario = Pick<Body<"ScenarioSummary">, "name" | "like" | "episode_s">;

/** Method → processor time of an episode as a multiple of one of `random`, in `low`. */
export type EpisodeCosts = Readonly<Record<string, number | null>>;

/** Seconds of an episode of `random` on a processor of our own. */
const REFERENCE_S: Readonly<Record<string, number>> = { low: 0.07, mixed: 0.09, dense: 0.35 };
const UNKNOWN_S = 0.1;

/** Scenario that a pattern of a map is most like. */
export const LIKE: Readonly<Record<Pattern, string>> = { car_following: "low", crossing: "mixed", junction: "dense" };

/** Where a time comes from: this method in this scenario here, another one here, or a processor of our own. */
export type Source = "measured" | "derived" | "reference";

export interface Time {
  seconds: number;
  source: Source;
}

export type TimeOf = (scenario: string, method: string) => Time;

export function timesOf(scenarios: readonly Scenario[], costs: EpisodeCosts): TimeOf {
  const known = new Map(scenarios.map((each) => [each.name, each]));
  const random = (name: string): Time => {
    const { like, episode_s = {} } = known.get(name) ?? {};
    const measured = episode_s.random;
    if (measured !== undefined) return { seconds: measured, source: "measured" };
    const shares = Object.entries(episode_s).flatMap(([method, seconds]) => (isPlain(costs[method]) ? [seconds / costs[method]!] : []));
    if (shares.length) return { seconds: Math.min(...shares), source: "derived" };
    if (like && like !== name && known.has(like)) return derived(random(like));
    return { seconds: REFERENCE_S[name] ?? REFERENCE_S[like ?? ""] ?? UNKNOWN_S, source: "reference" };
  };
  return (name, method) => {
    const measured = known.get(name)?.episode_s[method];
    if (measured !== undefined) return { seconds: measured, source: "measured" };
    const base = random(name);
    const cost = costs[method] ?? 1;
    if (method === "random") return base;
    // What a learner adds does not grow with the scenario's traffic.
    const seconds = isPlain(cost) ? base.seconds * cost : base.seconds + (cost - 1) * random("low").seconds;
    return derived({ ...base, seconds });
  };
}

function derived({ seconds, source }: Time): Time {
  return { seconds, source: source === "measured" ? "derived" : source };
}

/** Whether a method costs little but its simulations. */
function isPlain(cost: number | null | undefined): boolean {
  return typeof cost === "number" && cost <= 1.5;
}

const WORDS: Record<Source, string> = {
  measured: "as measured on this server",
  derived: "from other runs of this server",
  reference: "as on a processor of ours; nothing like it has run here yet",
};

/** `An episode takes 0.07 s in low, as measured on this server.`, a sentence for each source. */
export function timeWords(time: TimeOf, scenarios: readonly string[], methods: readonly string[]): string {
  const shown = [...new Set(scenarios)].map((name) => {
    const each = methods.map((method) => time(name, method));
    const [least, most] = [Math.min(...each.map(({ seconds }) => seconds)), Math.max(...each.map(({ seconds }) => seconds))];
    const source = (["reference", "derived", "measured"] as const).find((one) => each.some((time) => time.source === one))!;
    return { said: `${rounded(least) === rounded(most) ? "" : `${rounded(least)} to `}${rounded(most)} s in ${name}`, source };
  });
  return (["measured", "derived", "reference"] as const)
    .flatMap((source) => {
      const of = shown.filter((each) => each.source === source).map(({ said }) => said);
      const more = of.length > MOST_NAMED ? [...of.slice(0, MOST_NAMED), `and so on in ${of.length - MOST_NAMED} more`] : of;
      return of.length && methods.length ? [`An episode takes ${more.join(", ")}, ${WORDS[source]}.`] : [];
    })
    .join(" ");
}

const MOST_NAMED = 4;

function rounded(seconds: number): string {
  return seconds.toPrecision(seconds < 1 ? 1 : 2);
}
