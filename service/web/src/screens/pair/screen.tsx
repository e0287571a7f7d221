/** A failure beside its twin: the same scene with one thing changed, by one clock and one camera. */

import { useMemo, useRef } from "preact/hooks";
import { useAsked } from "../../api/asked";
import type { Body } from "../../api/types";
import { address } from "../../router";
import { Tripod } from "../../stage/camera";
import { Clock } from "../../stage/clock";
import { useKeys } from "../../stage/keys";
import { Legend } from "../../stage/legend";
import { opening } from "../../stage/panels";
import { Plots } from "../../stage/plots";
import { hiddenSpans, recordingOf, type Series } from "../../stage/recording";
import { roadPaths } from "../../stage/roads";
import { askedTime, conflictBounds, marksOf, useLayers, useStopped, useTimeInAddress } from "../../stage/room";
import { Stage } from "../../stage/stage";
import { KeyList, Transport } from "../../stage/transport";
import { Empty, Shown } from "../../ui/states";
import { useTitle } from "../../ui/title";
import { isContact, worstOf, type Collision, type Violation } from "../../ui/violations";
import { happenedOf, verdictOf } from "../replay/words";
import { between, commonTimes, pairPanels, sensorOf, TWINS } from "./twins";
import { Waiting } from "./waiting";
import "../../stage/stage.css";
import "./pair.css";

interface Props {
  campaign: string;
  failure: string;
  twin: string;
  query: URLSearchParams;
}

export function PairScreen({ campaign, failure, twin, query }: Props) {
  const path = `v1/campaigns/${encodeURIComponent(campaign)}/failures/${encodeURIComponent(failure)}`;
  const asked = useAsked<Body<"Failure">>(path);
  useTitle("Twin", failure);
  if (!(twin in TWINS)) return <Empty>There is no twin of this name. There are {Object.keys(TWINS).join(", ")}.</Empty>;
  const place = ["campaigns", campaign, "failures"];
  const kept = { t: query.get("t") ?? undefined };
  return (
    <>
      <div class="head">
        <nav class="crumbs" aria-label="Breadcrumb">
          <a href={address(["campaigns", campaign])}>Campaign</a> / <a href={address(place)}>Failures</a> /{" "}
          <a href={address([...place, failure], kept)}>{failure}</a> / Twin
        </nav>
        <h1>The failure and its twin</h1>
        <nav class="twins" aria-label="Twin">
          {Object.entries(TWINS).map(([kind, name]) => (
            <a class="button" href={address([...place, failure, "twin", kind], kept)} aria-current={kind === twin ? "page" : undefined}>
              {name}
            </a>
          ))}
        </nav>
      </div>
      <Shown asked={asked} what="the failure">
        {(known) => {
          const violation = worstOf(known);
          return known.series === null || violation === null ? (
            <Empty>{known.series_problem ?? "It has no recording to play."}</Empty>
          ) : (
            <Pair campaign={campaign} path={path} twin={twin} known={known} series={known.series} violation={violation} query={query} />
          );
        }}
      </Shown>
    </>
  );
}

interface PairProps {
  campaign: string;
  path: string;
  twin: string;
  known: Body<"Failure">;
  series: Series;
  violation: Collision | Violation;
  query: URLSearchParams;
}

function Pair({ campaign, path, twin, known, series, violation, query }: PairProps) {
  const asked = useAsked<Body<"TwinBody">>(`${path}/twins/${twin}`);
  const roads = useAsked<Body<"RoadsBody">>(`${path}/roads`).value;
  const sensor = useAsked<Body<"Campaign">>(`v1/campaigns/${encodeURIComponent(campaign)}`).value?.spec.ego?.sensor ?? null;
  const played = asked.value;
  const failure = useMemo(() => recordingOf(series, violation), [series, violation]);
  const other = useMemo(() => (played ? recordingOf(played.series, violation) : null), [played, violation]);
  const at = useRef<Clock>();
  const clock = useMemo(() => {
    const time = at.current?.time.get() ?? askedTime(query) ?? opening(failure); // the twin comes later, and time goes on
    return (at.current = new Clock(commonTimes(failure.time_s, other?.time_s ?? null), time));
  }, [failure, other]);
  const tripod = useMemo(() => new Tripod(conflictBounds(failure)), [failure]);
  const followed = useMemo(() => between(other ? [failure, other] : [failure]), [failure, other]);
  const panels = useMemo(() => (other ? pairPanels(failure, other, TWINS[twin]!.toLowerCase()) : []), [failure, other, twin]);
  const hidden = useMemo(() => hiddenSpans(failure, failure.striker), [failure]);
  const paths = useMemo(() => (roads ? roadPaths(roads) : null), [roads]);
  const marks = useMemo(() => marksOf(failure), [failure]);
  const [layers, toggle] = useLayers();
  useKeys({ clock, tripod, toggle });
  useStopped(clock);
  useTimeInAddress(clock, query);
  const shared = { roads: paths, clock, tripod, layers, followed };
  return (
    <div class="grid pair-screen">
      <div class="card stage-card">
        <div class="pair">
          <section aria-label="The failure">
            <Caption title="The failure" outcome={`${happenedOf(violation)} ${verdictOf(known)}`} kind="failed" />
            <Stage {...shared} recording={failure} sensor={sensor} label="The failure from above" />
          </section>
          <section aria-label="Its twin">
            <Caption title={TWINS[twin]!} outcome={played ? sentence(played.outcome) : ""} kind={isContact(violation) && !played?.collision ? "passed" : "failed"} />
            {other ? (
              <Stage {...shared} recording={other} original={false} sensor={sensorOf(twin, sensor)} label="Its twin from above" />
            ) : (
              <div class="stage pair-waiting">
                <Waiting error={asked.error} again={asked.again} key={twin} />
              </div>
            )}
          </section>
        </div>
        <Transport clock={clock} tripod={tripod} toggle={toggle} layers={layers} marks={marks} hidden={hidden} moment={failure.moment} />
        <Legend recording={failure} layers={layers} signals={!!paths?.signals.length} />
      </div>
      {other && (
        <>
          <p class="faint small time-hint">
            Time in s from the {failure.moment}. Blue: now; dotted: release{failure.conflict_s !== null && "; dashed: the conflict begins"}
            {hidden.length > 0 && `; shaded: the failure's ego does not see ${failure.ids[failure.striker]}`}.
          </p>
          <Plots panels={panels} clock={clock} marks={marks} hidden={hidden} />
        </>
      )}
      <section class="card" aria-label="Keys">
        <KeyList />
      </section>
    </div>
  );
}

function Caption({ title, outcome, kind }: { title: string; outcome: string; kind: "failed" | "passed" }) {
  return (
    <div class="pair-caption">
      <h2>{title}</h2>
      <p class={`small ${outcome && kind === "passed" ? "good" : ""}`}>{outcome || "\u00a0"}</p>
    </div>
  );
}

function sentence(text: string): string {
  return text.charAt(0).toUpperCase() + text.slice(1) + (text.endsWith(".") ? "" : ".");
}
