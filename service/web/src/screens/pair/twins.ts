/** The twins that a failure can have, and how a twin is put beside its failure. */

import type { Sensor } from "../../stage/scene";
import type { Curve, Panel } from "../../stage/panels";
import { column, DASHES, nearBy, softMinimum } from "../../stage/panels";
import type { Recording } from "../../stage/recording";
import type { Followed } from "../../stage/camera";
import { instantAt, posesAt } from "../../stage/interpolate";
import { words } from "../../ui/text";
import { requirementOf } from "../../ui/violations";

/** As the API names them, with what is different. */
export const TWINS: Record<string, string> = {
  idle: "No attack",
  default: "Default ego",
  perfect: "Perfect ego",
  careful: "Careful ego",
  defensive: "Defensive ego",
};

const DEFAULT_SENSOR: Sensor = { range_m: 80, field_of_view_rad: 2 * Math.PI, occlusion: true };

/** What the twin's ego sees with: its profile's sensor, or that of the campaign where the ego is the same. */
export function sensorOf(twin: string, campaign: Sensor | null): Sensor | null {
  if (twin === "idle") return campaign;
  return twin === "perfect" ? null : DEFAULT_SENSOR;
}

const APART_S = 0.01; // times that are nearer are one frame of both

/** The frames of both; a twin goes on after the contact. */
export function commonTimes(failure: ArrayLike<number>, twin: ArrayLike<number> | null): Float64Array {
  const all = [...Array.from(failure), ...Array.from(twin ?? [])].sort((a, b) => a - b);
  return Float64Array.from(all.filter((time, k) => k === 0 || time - all[k - 1]! > APART_S));
}

/** The middle between both egos, so that a camera for both has both in view. */
export function between(recordings: Recording[]): (time: number) => Followed {
  const poses = recordings.map(({ actors }) => new Float64Array(3 * actors));
  return (time) => {
    recordings.forEach((recording, k) => posesAt(recording, instantAt(recording.time_s, time), poses[k]!));
    const there = poses.filter(([x]) => !Number.isNaN(x));
    const mean = (k: number) => there.reduce((sum, pose) => sum + pose[k]!, 0) / there.length;
    return { x: mean(0), y: mean(1), heading: poses[0]![2]! };
  };
}

/** The same measurement of both, in one panel each. */
export function pairPanels(failure: Recording, twin: Recording, name: string): Panel[] {
  const both = (values: (recording: Recording) => Curve["values"]): Curve[] => [
    { name: "failure", time_s: failure.time_s, values: values(failure), colour: "--text", width: 2 },
    { name, time_s: twin.time_s, values: values(twin), colour: "--series-3", dash: DASHES.striker, width: 2 },
  ];
  const striker = (recording: Recording) => Math.max(recording.striker, 0);
  const requirement = requirementOf(failure.violation);
  const robustness = ({ series }: Recording) => column(series.robustness, series.requirements.indexOf(requirement));
  return [
    ...(failure.moment === "violation" ? [{ title: `${words(requirement)}, violated below 0`, unit: "in scales", curves: both(robustness), zero: true }] : []),
    { title: "Ego's speed", unit: "m/s", curves: both(({ series }) => column(series.speed_mps, 0)) },
    ...(failure.striker < 0
      ? []
      : [{ title: `Distance to ${failure.moment === "contact" ? "the striker" : failure.ids[failure.striker]}`, unit: "m; scaled to the conflict", curves: both((recording) => column(recording.series.distance_m, striker(recording))), range: nearBy(failure), zero: true }]),
    {
      title: "Soft minimum, violated below 0",
      unit: "",
      curves: [softMinimum(failure, "failure", "--text"), softMinimum(twin, name, "--series-3", DASHES.striker)],
      zero: true,
    },
  ];
}
