/** Filters, plots and cards of a campaign's failures, all by what the address says. */

import { useEffect, useMemo, useState } from "preact/hooks";
import { keepListed } from "../../listed";
import { address, go, replace } from "../../router";
import { signal } from "../../signal";
import { count } from "../../ui/text";
import { NO_CONTACT } from "../../ui/violations";
import { within, type Brushes } from "./brushes";
import { Cards } from "./cards";
import { Controls } from "./controls";
import { outcomeFeatures, sceneFeatures } from "./features";
import { groupsOf, inTab, isNarrowed, passing, queryOf, read, reset, type By, type Filters } from "./filters";
import { foundOf } from "./found";
import { Parallel } from "./parallel";
import { RefusedBy } from "./refused";
import { Scatter } from "./scatter";
import { oneEach, sorted, SORTS, SORTS_OF, underKinds, type Sort } from "./sorting";
import { TriageDialog, noted, useNoting } from "./triage";
import type { FailureTable } from "./wire";

/** As `risk_sac/failures/thumbnail.py` draws them. */
const PICTURED = [
  ["ego", "ego and its path"],
  ["striker", "striker, or the nearest road user, and its path"],
  ["other", "others"],
  ["green", "signal: green"],
  ["red", "red"],
  ["yellow", "yellow"],
] as const;
const AXES = 7; // outcome features among the parallel coordinates; the scatter plot offers all of them
const SHOWN: Record<By, string> = { kind: "kinds of failures", variant: "variants", episode: "failing episodes" };
const WIDE = "(min-width: 1000px)"; // as in failures.css

export function Explorer({ campaign, query, table: read_ }: { campaign: string; query: URLSearchParams; table: FailureTable }) {
  const noting = useNoting(campaign);
  const table = useMemo(() => noted(read_, noting.notes), [read_, noting.notes]);
  const asked = useMemo(() => read(query), [query.toString()]);
  const [dragged, setDragged] = useState<Brushes | null>(null);
  const [plots, setPlots] = useState(() => matchMedia(WIDE).matches);
  const [open, setOpen] = useState<number | null>(null);
  const hovered = useMemo(() => signal<number | null>(null), []);
  const filters = dragged ? { ...asked, brushes: dragged } : asked;
  const place = (some: Filters) => address(["campaigns", campaign, "failures"], queryOf(some));
  const show = (next: Filters) => replace(place(next));
  const change = (changed: Partial<Filters>) => show({ ...asked, ...changed });
  const brush = (brushes: Brushes, done: boolean) => {
    setDragged(done ? null : brushes);
    if (done) change({ brushes });
  };

  const by: By = asked.tab === "failures" ? asked.by : "episode";
  const found = useMemo(() => foundOf(read_, by), [read_, by]);
  const often = useMemo(() => Int32Array.from(found, ({ episodes }) => episodes), [found]);
  const groups = groupsOf(table, by);
  const one = (some: readonly number[]) => (groups ? oneEach(table, some, often, groups) : some);
  const episodes = useMemo(() => inTab(table, asked), [read_, asked.tab]);
  const all = useMemo(() => one(episodes), [episodes, by]);
  const families = useMemo(() => [...new Set(table.families)], [read_]);
  const family = asked.family || (families.length === 1 ? families[0]! : "");
  const outcomes = useMemo(() => outcomeFeatures(read_), [read_]);
  const scene = useMemo(() => sceneFeatures(read_, family), [read_, family]);
  const features = useMemo(() => [...outcomes, ...scene], [outcomes, scene]);
  const axes = useMemo(() => [...outcomes.filter(({ values }) => !values.every(Number.isNaN)).slice(0, AXES), ...scene], [outcomes, scene]);
  // What contacts are plotted by at first, a violation without contact does not have.
  const touched = asked.requirement ? asked.requirement === NO_CONTACT : read_.requirement.includes(NO_CONTACT);
  const plotted = useMemo(() => (asked.family ? all.filter((i) => table.families[i] === asked.family) : all), [all, asked.family]);
  const passed = useMemo(() => passing(table, episodes, asked), [table, episodes, asked]);
  const shown = useMemo(
    () => {
      const all = sorted(table, one(within(passed, filters.brushes, features)), asked.sort, often);
      return by === "variant" ? underKinds(table, all) : all;
    },
    [table, passed, filters.brushes, features, asked.sort, by],
  );
  useEffect(() => keepListed({ campaign, ids: shown.map((at) => table.ids[at]!), query: query.toString() }), [shown, query.toString()]);
  const again = noting.refused;
  const dialogFor = open ?? (again ? table.ids.indexOf(again.failure) : null);
  const close = () => {
    setOpen(null);
    noting.forgive();
  };
  return (
    <>
      <Controls {...{ table, episodes, by, filters: asked, change }} resetAll={() => show(reset(asked))} />
      <div class="explorer" data-plots={plots || undefined}>
        {plots && (
          <aside class="plots" aria-label="Plots" tabIndex={0}>
            {asked.tab === "refused" && <RefusedBy {...{ table, all }} chosen={asked.rule} choose={(rule) => change({ rule })} />}
            <Scatter
              {...{ table, features, shown, hovered }}
              x={touched ? asked.x : asked.x === "reaction" ? "time" : asked.x}
              y={touched ? asked.y : asked.y === "closing" ? "ego_speed" : asked.y}
              all={plotted}
              choose={change}
              open={(i) => go(address(["campaigns", campaign, "failures", table.ids[i]!]))}
            />
            {!family && <FamilyHint families={families} choose={(chosen) => change({ family: chosen })} />}
            <Parallel {...{ table, shown, hovered, brush }} features={axes} all={plotted} brushes={filters.brushes} />
          </aside>
        )}
        <section class="found" aria-label="Failures">
          <div class="row found-head">
            <p role="status">
              <b>{count(shown.length)}</b> of {count(all.length)} {asked.tab === "refused" ? "refused" : SHOWN[by]}
            </p>
            {asked.tab === "failures" && (
              <label class="sort">
                Show{" "}
                <select value={by} onChange={(event) => change({ by: event.currentTarget.value as By })}>
                  <option value="kind">one of each kind</option>
                  <option value="variant">one of each variant</option>
                  <option value="episode">every episode</option>
                </select>
              </label>
            )}
            <label class="sort">
              Order{" "}
              <select value={SORTS_OF[asked.tab].includes(asked.sort) ? asked.sort : "closing"} onChange={(event) => change({ sort: event.currentTarget.value as Sort })}>
                {SORTS_OF[asked.tab].map((sort) => (
                  <option key={sort} value={sort}>
                    {SORTS[sort]}
                  </option>
                ))}
              </select>
            </label>
            <button aria-pressed={plots} onClick={() => setPlots(!plots)}>
              Plots
            </button>
          </div>
          <PictureLegend />
          {shown.length ? (
            <Cards
              {...{ campaign, table, found, shown, hovered }}
              triage={setOpen}
              place={place(asked)}
              variants={by === "kind" ? (kind) => place({ ...asked, by: "variant", kind }) : null}
            />
          ) : (
            <Nothing filters={filters} all={all.length} resetAll={() => show(reset(asked))} />
          )}
        </section>
      </div>
      {dialogFor !== null && dialogFor >= 0 && (
        <TriageDialog
          key={`${dialogFor} ${again ? "again" : ""}`}
          campaign={campaign}
          failure={table.ids[dialogFor]!}
          refused={again}
          close={close}
          save={(triage) => {
            setOpen(null);
            noting.save(table.ids[dialogFor]!, triage);
          }}
        />
      )}
    </>
  );
}

/** What the colours of the cards' pictures mean. */
function PictureLegend() {
  return (
    <ul class="legend picture-legend small" aria-label="Legend of the pictures">
      {PICTURED.map(([mark, name]) => (
        <li key={mark}>
          <span class={`key key-${mark}`} aria-hidden="true" /> {name}
        </li>
      ))}
    </ul>
  );
}

function FamilyHint({ families, choose }: { families: readonly string[]; choose: (family: string) => void }) {
  return (
    <p class="row small faint hint">
      Add the scene's parameters of
      {families.map((each) => (
        <button key={each} onClick={() => choose(each)}>
          {each}
        </button>
      ))}
    </p>
  );
}

function Nothing({ filters, all, resetAll }: { filters: Filters; all: number; resetAll: () => void }) {
  const what = filters.tab === "refused" ? "refused violation" : "failure";
  return (
    <div class="state">
      <p>{all && isNarrowed(filters) ? `No ${what} passes all the filters.` : `There is no ${what}.`}</p>
      {isNarrowed(filters) && (
        <button class="primary" onClick={resetAll}>
          Reset the filters
        </button>
      )}
    </div>
  );
}
