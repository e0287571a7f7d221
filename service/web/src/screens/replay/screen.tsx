/** The replay of a failure: the view from above, the measured curves and the verdict. */

import { useMemo, useRef } from "preact/hooks";
import { useAsked } from "../../api/asked";
import type { Body } from "../../api/types";
import { listedAround } from "../../listed";
import { address } from "../../router";
import { Tripod } from "../../stage/camera";
import { Clock } from "../../stage/clock";
import { useKeys } from "../../stage/keys";
import { Legend } from "../../stage/legend";
import { opening, panelsOf } from "../../stage/panels";
import { Plots } from "../../stage/plots";
import { hiddenSpans, recordingOf, type Series } from "../../stage/recording";
import { roadPaths } from "../../stage/roads";
import { askedTime, conflictBounds, marksOf, useLayers, useStopped, useTimeInAddress } from "../../stage/room";
import { Stage } from "../../stage/stage";
import { KeyList, Transport } from "../../stage/transport";
import { DrivenTag } from "../../ui/driven";
import { ScenarioNames } from "../../ui/scenario";
import { Empty, Shown } from "../../ui/states";
import { capital, words } from "../../ui/text";
import { useTitle } from "../../ui/title";
import { GRADE_WORDS } from "../../ui/verdicts";
import { faultOf, gradeOf, kindOf, plausibilityOf, severityOf, variantOf, worstOf, type Collision, type Violation } from "../../ui/violations";
import { Actors } from "./actors";
import { Take } from "./take";
import { Verdict } from "./verdict";
import "../../stage/stage.css";
import "./replay.css";

interface Props {
  campaign: string;
  failure: string;
  query: URLSearchParams;
}

export function ReplayScreen({ campaign, failure, query }: Props) {
  const path = `v1/campaigns/${encodeURIComponent(campaign)}/failures/${encodeURIComponent(failure)}`;
  const asked = useAsked<Body<"Failure">>(path);
  const about = useAsked<Body<"Campaign">>(`v1/campaigns/${encodeURIComponent(campaign)}`).value;
  const family = about?.runs.find(({ id }) => id === asked.value?.run_id)?.family;
  return (
    <>
      <Head campaign={campaign} failure={failure} query={query} known={asked.value} family={family} />
      <Shown asked={asked} what="the failure">
        {(known) => {
          const violation = worstOf(known);
          return known.series === null || violation === null ? (
            <>
              <Empty>{known.series_problem ?? "It has no recording to play."}</Empty>
              <Verdict failure={known} />
            </>
          ) : (
            <Replay campaign={campaign} path={path} known={known} series={known.series} violation={violation} spec={about?.spec} query={query} />
          );
        }}
      </Shown>
    </>
  );
}

function Head({ campaign, failure, query, known, family }: Props & { known: Body<"Failure"> | undefined; family: string | undefined }) {
  const listed = listedAround(campaign, failure);
  const neighbour = (id: string | null | undefined, text: string) =>
    id && (
      <a class="button" href={address(["campaigns", campaign, "failures", id])}>
        {text}
      </a>
    );
  const violation = known && worstOf(known);
  const kind = violation && kindOf(violation);
  useTitle(kind && capital(kind), failure);
  return (
    <div class="head">
      <nav class="crumbs" aria-label="Breadcrumb">
        <a href={address(["campaigns", campaign])}>Campaign</a> /{" "}
        <a href={`${address(["campaigns", campaign, "failures"])}${listed.query && `?${listed.query}`}`}>Failures</a> / {failure}
      </nav>
      <h1>{kind ? capital(kind) : `Failure ${failure}`}</h1>
      {kind && (
        <p class="variant faint">
          {capital(variantOf(violation))}. <a href={address(["campaigns", campaign, "failures"], { kind, by: "variant" })}>Variants of this kind</a>
        </p>
      )}
      {family && <ScenarioNames names={[family]} />}
      {known && <Tags failure={known} />}
      <span class="actions">
        {neighbour(query.get("prev") ?? listed.previous, "Previous")}
        {neighbour(query.get("next") ?? listed.next, "Next")}
        <a class="button" href={address(["campaigns", campaign, "failures", failure, "twin", "idle"])}>
          Compare with a twin
        </a>
      </span>
    </div>
  );
}

interface Played {
  campaign: string;
  path: string;
  known: Body<"Failure">;
  series: Series;
  violation: Collision | Violation;
  spec: Body<"Campaign">["spec"] | undefined;
  query: URLSearchParams;
}

function Replay({ campaign, path, known, series, violation, spec, query }: Played) {
  const roads = useAsked<Body<"RoadsBody">>(`${path}/roads`).value;
  const recording = useMemo(() => recordingOf(series, violation), [series, violation]);
  const clock = useMemo(() => new Clock(recording.time_s, askedTime(query) ?? opening(recording)), [recording]);
  const tripod = useMemo(() => new Tripod(conflictBounds(recording)), [recording]);
  const panels = useMemo(() => panelsOf(recording), [recording]);
  const marks = useMemo(() => marksOf(recording), [recording]);
  const hidden = useMemo(() => hiddenSpans(recording, recording.striker), [recording]);
  const paths = useMemo(() => (roads ? roadPaths(roads) : null), [roads]);
  const [layers, toggle] = useLayers();
  const card = useRef<HTMLElement>(null);
  useKeys({ clock, tripod, toggle });
  useStopped(clock);
  useTimeInAddress(clock, query);
  return (
    <div class="grid replay-screen">
      <div class="replay">
        <div class="replay-main">
        <section class="card stage-card" ref={card} aria-label="Replay">
          <Stage
            recording={recording}
            roads={paths}
            sensor={spec?.ego?.sensor ?? null}
            clock={clock}
            tripod={tripod}
            layers={layers}
            label="View from above; the table of actors says in text what is seen"
          />
          <Transport clock={clock} tripod={tripod} toggle={toggle} layers={layers} marks={marks} hidden={hidden} moment={recording.moment} />
          <Legend recording={recording} layers={layers} signals={!!paths?.signals.length} />
        </section>
        <p class="faint small time-hint">
          Time in s from the {recording.moment}. Blue: now; dotted: release
          {recording.conflict_s !== null && "; dashed: the conflict begins"}
          {hidden.length > 0 && `; shaded: the ego does not see ${recording.ids[recording.striker]}`}.
        </p>
        <Plots panels={panels} clock={clock} marks={marks} hidden={hidden} />
        </div>
        <Verdict failure={known} />
      </div>
      <Actors recording={recording} clock={clock} />
      <div class="replay-end">
        <Take campaign={campaign} run={known.run_id} failure={known.id} path={path} stage={card} />
        <section class="card" aria-label="Keys">
          <KeyList />
        </section>
      </div>
    </div>
  );
}

function Tags({ failure }: { failure: Body<"Failure"> }) {
  const violation = worstOf(failure);
  const [grade, severity, fault] = violation ? [gradeOf(violation), severityOf(violation), faultOf(violation)] : [];
  const plausibility = violation && plausibilityOf(violation);
  return (
    <>
      <span class={`tag ${grade ?? ""}`}>{grade ? GRADE_WORDS[grade].short : words(failure.outcome)}</span>
      {plausibility && (
        <span class="tag" title={plausibility.sentence}>
          {plausibility.verdict}
        </span>
      )}
      {severity && <span class="tag">{severity}</span>}
      {fault && <span class="tag">fault: {fault}</span>}
      <DrivenTag by={failure.driven_by} />
    </>
  );
}
