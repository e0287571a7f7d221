/** What is compared, as rows: a method's cell of a report, or a campaign's total of a method. Pure. */

import type { Body } from "../../api/types";
import type { Requirements } from "../../ui/requirements";
import type { Mark } from "../campaign/look";

export interface Estimate {
  mean: number | null;
  low: number | null;
  high: number | null;
}

export interface Row {
  key: string;
  name: string;
  mark: Mark;
  runs: number;
  episodes: number;
  rejected: number;
  raw_collisions: number;
  failures: number;
  distinct_failures: number;
  distinct_preventable: number;
  distinct_published: number;
  headline_candidates: number;
  implausible: number;
  /** Each kind once over the row's runs; null before a replay. */
  headline: number | null;
  headline_published: number | null;
  /** Requirement -> its funnel; none in what was stored before requirements were counted. */
  requirements: Requirements;
  /** Reference driver -> its own PCR. */
  pcr_by_driver: Record<string, Body<"DriverPcr">>;
  by_severity: Record<string, number>;
  by_fault: Record<string, number>;
  /** What drove -> episodes, and headline failures; empty in what was stored before that was recorded. */
  episodes_driven_by: Record<string, number>;
  headline_driven_by: Record<string, number>;
  ecr: Estimate;
  pcr: Estimate;
  more: More;
}

/** What is told on request. */
export interface More {
  efficiency: Estimate;
  cost_rate: Estimate;
  dispersion: Estimate;
  steps_per_distinct_failure: number | null;
  cpu_s_per_distinct_failure?: number | null;
  artefacts: number;
  unresponsive_share: number | null;
  preventable: number;
  environment_steps: number;
}

const COUNTS = ["episodes", "rejected", "raw_collisions", "failures", "distinct_failures", "distinct_preventable", "distinct_published", "headline_candidates", "implausible", "headline", "headline_published", "requirements", "pcr_by_driver", "by_severity", "by_fault", "episodes_driven_by", "headline_driven_by"] as const;
const FURTHER = ["artefacts", "unresponsive_share", "preventable", "environment_steps", "steps_per_distinct_failure"] as const;
const NOTHING: Estimate = { mean: null, low: null, high: null };

export function rowOfCell(cell: Body<"Cell">, mark: Mark): Row {
  const estimate = (name: string) => cell.estimates[name] ?? NOTHING;
  return {
    key: cell.method,
    name: cell.method,
    mark,
    runs: cell.seeds.length,
    ...picked(cell, COUNTS),
    ecr: estimate("ecr"),
    pcr: estimate("pcr"),
    more: {
      ...picked(cell, FURTHER),
      efficiency: estimate("es"),
      cost_rate: estimate("rho_c"),
      dispersion: estimate("ofd"),
      cpu_s_per_distinct_failure: cell.cpu_s_per_distinct_failure,
    },
  };
}

export function rowOfTotal(total: Body<"Total">, campaign: string, name: string, mark: Mark): Row {
  return {
    key: `${campaign} ${total.method}`,
    name,
    mark,
    runs: total.runs,
    ...picked(total, COUNTS),
    ecr: { mean: total.ecr, low: total.ecr_low, high: total.ecr_high },
    pcr: { mean: total.pcr, low: total.pcr_low, high: total.pcr_high },
    more: {
      ...picked(total, FURTHER),
      efficiency: { ...NOTHING, mean: total.efficiency },
      cost_rate: { ...NOTHING, mean: total.cost_rate },
      dispersion: { ...NOTHING, mean: total.dispersion },
    },
  };
}

function picked<T, Name extends keyof T>(from: T, names: readonly Name[]): Pick<T, Name> {
  return Object.fromEntries(names.map((name) => [name, from[name]])) as Pick<T, Name>;
}

export function percent(value: number | null, digits = 1): string {
  return value === null ? "–" : `${(100 * value).toFixed(digits)} %`;
}

/** `[12.7, 24.9]`; empty without an interval. */
export function bracket({ low, high }: Estimate, factor = 100, digits = 1): string {
  return low === null || high === null ? "" : `[${(factor * low).toFixed(digits)}, ${(factor * high).toFixed(digits)}]`;
}
