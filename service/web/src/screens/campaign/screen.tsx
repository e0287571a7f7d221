/** A campaign as it goes on, or as it ended. */

import { useCallback, useState } from "preact/hooks";
import { Problem } from "../../api/client";
import { ended } from "../../api/ended";
import { Empty, Failed, Loading } from "../../ui/states";
import { RequirementTable } from "../../ui/requirements";
import { count, number, waitingWords } from "../../ui/text";
import { useTitle } from "../../ui/title";
import { Boundaries } from "./boundaries";
import { Charts } from "./charts";
import { Funnel } from "./funnel";
import { Grids } from "./grid";
import { Header } from "./header";
import { useLive } from "./live";
import { Newest } from "./newest";
import { FirstRanked } from "./ranked";
import { RatesOfCampaign } from "./rates";
import { Runs } from "./runs";
import { Scenes } from "./scenes";
import { Worth } from "./worth";
import "./campaign.css";

export function CampaignScreen({ id }: { id: string }) {
  const { campaign, curves, found, error, again } = useLive(id);
  useTitle(campaign?.label || id);
  const [hidden, setHidden] = useState<ReadonlySet<string>>(new Set());
  const hide = useCallback((runs: string[], away: boolean) => {
    setHidden((before) => {
      const after = new Set(before);
      for (const run of runs) away ? after.add(run) : after.delete(run);
      return after;
    });
  }, []);
  if (!campaign && error instanceof Problem && error.status === 404) {
    return (
      <div class="state" role="alert">
        <h1>There is no such campaign</h1>
        <p class="breaking">No campaign has the id “{id}”; it may have been deleted.</p>
        <a href="#/campaigns">To the campaigns</a>
      </div>
    );
  }
  if (!campaign) return error ? <Failed error={error} again={again} /> : <Loading what="the campaign" />;
  const { progress } = campaign;
  const waiting = progress.headline_waiting;
  const drawn = curves?.some((curve) => curve.episodes.length);
  return (
    <div class="live">
      <Header campaign={campaign} again={again} />
      <div class="standing">
        <section class="card" aria-labelledby="funnel-title">
          <h2 id="funnel-title">From failures to what is worth your time</h2>
          <Funnel counts={progress} />
          {progress.failures > 0 && <FirstRanked campaign={campaign} />}
          {campaign.runs.length > 1 && (
            <p class="stage-note small faint">
              Distinct, preventable, plausible and implausible are summed over the runs; headline counts what several runs found alike once.
            </p>
          )}
        </section>
        <section class="card tiles" aria-label="Where the search stands">
          <Tile name={waiting ? `headline failures; ${waitingWords(waiting)}` : "headline failures"} value={known(progress.headline)} title={HEADLINE} />
          <Tile name="of these, by R157, FSM or RSS" value={known(progress.headline_published)} title={PUBLISHED} />
          <Tile name="sliding ECR" value={percent(progress.window_ecr)} title={OVER} />
          <Tile name="sliding PCR" value={percent(progress.window_pcr)} title={OVER} />
          <Tile name="dual variable λ" value={number(progress.dual_variable)} title={OVER} />
          <Tile name="preventable, repeats too" value={count(progress.preventable)} />
          <Tile name="scenes rejected" value={count(progress.rejected)} />
          <Tile name="runs ended" value={`${campaign.runs.filter((run) => ended(run)).length} of ${campaign.runs.length}`} />
        </section>
        {!ended(campaign) && <Newest campaign={id} found={found} />}
      </div>
      {Object.keys(campaign.requirements).length > 0 && (
        <section class="card" aria-labelledby="requirements-title">
          <h2 id="requirements-title">By requirement</h2>
          <RequirementTable requirements={campaign.requirements} of="the campaign" campaign={id} />
        </section>
      )}
      {error && !(error instanceof TypeError) && <Failed error={error} again={again} />}
      {drawn ? (
        <Charts spec={campaign.spec} curves={curves!} hidden={hidden} hide={hide} />
      ) : (
        <section class="card">
          {curves ? <Empty>{ended(campaign) ? "No episode was finished." : "Curves begin with the first episode."}</Empty> : <Loading what="curves" />}
        </section>
      )}
      {campaign.progress.episodes_done > 0 && <Scenes campaign={campaign} />}
      <Grids campaign={campaign} />
      <RatesOfCampaign campaign={campaign} />
      <Boundaries campaign={campaign} />
      <Runs campaign={campaign} hidden={hidden} hide={hide} />
      <Worth campaign={campaign} />
    </div>
  );
}

const OVER = "Mean over the runs at work, or over all once none is; without controls such as random, unless there is nothing else.";

const PUBLISHED = "Kinds in the headline that a published reference driver would have prevented; the others only an anticipating one would.";
const HEADLINE =
  "Distinct, preventable, no minor contact, and the same when replayed. What several runs found alike counts once. A run is replayed at its end.";

function Tile({ name, value, title }: { name: string; value: string; title?: string }) {
  return (
    <div class="tile" title={title}>
      <b>{value}</b>
      <span>{name}</span>
    </div>
  );
}

function known(value: number | null): string {
  return value === null ? "–" : count(value);
}

function percent(value: number | null): string {
  return value === null ? "–" : `${number(100 * value, 1)} %`;
}
