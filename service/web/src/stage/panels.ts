/** What the plots below a stage show of a recording: a panel for each kind of measurement. */

import { words } from "../ui/text";
import { isContact, requirementOf } from "../ui/violations";
import type { Colour } from "./colours";
import type { Recording } from "./recording";
import { TTC_CAP_S } from "./risk";

type Values = (number | null)[];

export interface Curve {
  name: string;
  time_s: ArrayLike<number>;
  values: Values;
  colour: Colour;
  /** Lengths of dashes and gaps; none for a whole line. */
  dash?: number[];
  width?: number;
}

export interface Panel {
  title: string;
  unit: string;
  curves: Curve[];
  /** Ends of the scale; where they are not given, it goes by the values. */
  range?: [number, number];
  /** Whether a line is drawn at 0. */
  zero?: boolean;
}

const SERIES: Colour[] = ["--series-1", "--series-3", "--series-4", "--series-5", "--series-6", "--series-2"];
const BEFORE_S = 1; // of the conflict
const BOLD = 2.2;
export const DASHES = { striker: [6, 3], other: [2, 3] };

export function panelsOf(recording: Recording): Panel[] {
  const { series, striker } = recording;
  const violated = requirementCurve(recording);
  return [
    ...(violated ? [violated] : []),
    { title: "Speed", unit: "m/s", curves: both(recording, series.speed_mps) },
    { title: "Acceleration", unit: "m/s²", curves: both(recording, series.accel_mps2), zero: true },
    ...(striker < 0 ? [] : [distance(recording), timeToCollision(recording)]),
    requirements(recording),
    actions(recording),
  ];
}

export function column(rows: Values[], i: number): Values {
  return rows.map((row) => row[i] ?? null);
}

function both(recording: Recording, rows: Values[]): Curve[] {
  const { time_s, ids, striker } = recording;
  const curves: Curve[] = [{ name: "ego", time_s, values: column(rows, 0), colour: "--ego" }];
  if (striker >= 0) curves.push({ name: ids[striker]!, time_s, values: column(rows, striker), colour: "--striker", dash: DASHES.striker });
  return curves;
}

function towards({ moment, ids, striker }: Recording): string {
  return moment === "contact" ? "to the striker" : `to ${ids[striker]}`;
}

function distance(recording: Recording): Panel {
  const { time_s, series, striker } = recording;
  const curve: Curve = { name: towards(recording), time_s, values: column(series.distance_m, striker), colour: "--text" };
  return { title: "Distance", unit: "m; scaled to the conflict", curves: [curve], range: nearBy(recording), zero: true };
}

const LEAST_M = 5;

/** From 0 to the greatest distance of the conflict: an approach from far away would flatten it. */
export function nearBy(recording: Recording): [number, number] {
  const from = opening(recording);
  const values = column(recording.series.distance_m, recording.striker);
  const near = values.filter((value, step) => value !== null && recording.time_s[step]! >= from) as number[];
  return [0, 1.08 * Math.max(LEAST_M, ...near)];
}

/** Shortly before it becomes critical: where a replay opens, and what the camera fits. */
export function opening(recording: Recording): number {
  return (recording.conflict_s ?? -3) - BEFORE_S;
}

function timeToCollision(recording: Recording): Panel {
  const { time_s, series, striker } = recording;
  const values = column(series.ttc_s, striker).map((ttc) => (ttc === null ? null : Math.min(ttc, TTC_CAP_S)));
  const curve: Curve = { name: towards(recording), time_s, values, colour: "--text" };
  return { title: "Time to collision", unit: `s; ${TTC_CAP_S}: no collision course`, curves: [curve], range: [0, TTC_CAP_S * 1.04] };
}

/** The requirement that was violated without contact, by itself: of all of them, it is the one to look at. */
function requirementCurve({ time_s, series, violation }: Recording): Panel | null {
  const name = requirementOf(violation);
  const at = series.requirements.indexOf(name);
  if (isContact(violation) || at < 0) return null;
  const curve: Curve = { name: "robustness", time_s, values: column(series.robustness, at), colour: "--bad", width: BOLD };
  return { title: `${words(name)}, violated below 0`, unit: "in scales", curves: [curve], zero: true };
}

function requirements({ time_s, series, violation }: Recording): Panel {
  const curves: Curve[] = series.requirements.map((name, i) => ({
    name: words(name),
    width: name === requirementOf(violation) ? BOLD : undefined,
    time_s,
    values: column(series.robustness, i),
    colour: SERIES[i % SERIES.length]!,
    dash: i % 2 === 0 ? undefined : DASHES.striker,
  }));
  curves.push(softMinimum({ time_s, series } as Recording, "soft minimum", "--text"));
  return { title: "Requirements, violated below 0", unit: "", curves, zero: true };
}

export function softMinimum({ time_s, series }: Recording, name: string, colour: Colour, dash?: number[]): Curve {
  return { name, time_s, values: series.soft_min, colour, dash, width: BOLD };
}

/** Each adversary has two: drive and steer. The striker's are bold. */
function actions({ time_s, series, ids, parts }: Recording): Panel {
  const adversaries = ids.filter((_, i) => series.role[i] === "adversary");
  const curves = adversaries.flatMap((id, k): Curve[] => {
    const strikes = parts[ids.indexOf(id)] === "striker";
    const colour = strikes ? "--striker" : SERIES[(k + 1) % (SERIES.length - 1)]!;
    const width = strikes ? 2 : 1;
    return [
      { name: `${id} drives`, time_s, values: column(series.actions, 2 * k), colour, width },
      { name: `${id} steers`, time_s, values: column(series.actions, 2 * k + 1), colour, width, dash: DASHES.striker },
    ];
  });
  return { title: "Actions", unit: "of full", curves, range: [-1.08, 1.08], zero: true };
}
