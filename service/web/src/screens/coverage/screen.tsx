/** What campaigns have covered, cell by cell, with the campaigns behind each. */

import { useAsked } from "../../api/asked";
import type { Body } from "../../api/types";
import { address, replace } from "../../router";
import { Empty, Shown } from "../../ui/states";
import { count } from "../../ui/text";
import { useTitle } from "../../ui/title";
import { ORDER, STATES, filtered, type Group, type Matrix, type State } from "./cells";
import { Pairs } from "./pairs";
import { RowOfCells } from "./row";
import "./coverage.css";

/** @param campaign whose coverage it is; without one that of all campaigns of the project. */
export function CoverageScreen({ campaign, query }: { campaign?: string; query: URLSearchParams }) {
  useTitle("Coverage");
  const ego = query.get("ego") ?? "";
  const path = campaign === undefined ? `v1/coverage${ego && `?${new URLSearchParams({ ego })}`}` : `v1/campaigns/${encodeURIComponent(campaign)}/coverage`;
  const asked = useAsked<Matrix>(path);
  const parts = campaign === undefined ? ["coverage"] : ["campaigns", campaign, "coverage"];
  const state = ORDER.find((each) => each === query.get("state"));
  return (
    <div class="coverage grid">
      <div class="head">
        {campaign !== undefined && (
          <p class="crumbs">
            <a href="#/campaigns">Campaigns</a> / <a href={address(["campaigns", campaign])}>{asked.value?.campaigns[0]?.label || campaign}</a> / Coverage
          </p>
        )}
        <h1>Coverage</h1>
        {campaign === undefined && <EgoChoice ego={ego} />}
      </div>
      <Shown asked={asked} what="the coverage">
        {(matrix) =>
          matrix.campaigns.length === 0 ? (
            <Empty>
              No campaign{ego && ` of ${ego}`} has a finished run. <a href="#/new">Post one</a>
            </Empty>
          ) : (
            <>
              <Behind matrix={matrix} />
              <States matrix={matrix} state={state} choose={(next) => replace(address(parts, { ego, state: next }))} />
              {matrix.groups.map((group) => (
                <Section key={group.name} group={group} state={state} matrix={matrix} />
              ))}
              {matrix.pairs.length > 0 && <Pairs pairs={matrix.pairs} />}
              <section class="card" aria-labelledby="limits">
                <h2 id="limits">What this does not show</h2>
                <ul class="limits">
                  {matrix.limits.map((limit) => (
                    <li key={limit}>{limit}</li>
                  ))}
                </ul>
              </section>
            </>
          )
        }
      </Shown>
    </div>
  );
}

function EgoChoice({ ego }: { ego: string }) {
  const { value } = useAsked<Body<"Egos">>("v1/egos");
  const names = [...new Set([...(ego ? [ego] : []), ...(value?.items.map(({ name }) => name) ?? [])])];
  return (
    <label class="row">
      Ego{" "}
      <select value={ego} onChange={(event) => replace(address(["coverage"], { ego: event.currentTarget.value }))}>
        <option value="">all together</option>
        {names.map((name) => (
          <option key={name}>{name}</option>
        ))}
      </select>
    </label>
  );
}

function Behind({ matrix: { campaigns, definitions } }: { matrix: Matrix }) {
  const sum = (of: "episodes" | "failures") => count(campaigns.reduce((all, campaign) => all + campaign[of], 0));
  const open = campaigns.filter(({ complete }) => !complete).length;
  return (
    <p class="faint">
      {campaigns.length === 1 ? "1 campaign" : `${count(campaigns.length)} campaigns`}, {sum("episodes")} episodes, {sum("failures")} failures
      {definitions.length > 0 && `, judged by definitions ${definitions.join(" and ")}`}
      {open > 0 && `; of ${count(open)} not all runs have finished`}. Choose a cell to see what is behind it.
    </p>
  );
}

/** How many cells are in each state; one state alone is shown on request. */
function States({ matrix, state, choose }: { matrix: Matrix; state: State | undefined; choose: (state: State | undefined) => void }) {
  return (
    <div class="row" role="group" aria-label="Cells by state">
      {ORDER.map((each) => (
        <button key={each} class={`state-choice cell-${each}`} aria-pressed={state === each} onClick={() => choose(state === each ? undefined : each)}>
          <span aria-hidden="true">{STATES[each][1]}</span> {STATES[each][0]} <b>{count(matrix.cells[each] ?? 0)}</b>
        </button>
      ))}
    </div>
  );
}

function Section({ group, state, matrix }: { group: Group; state: State | undefined; matrix: Matrix }) {
  const rows = filtered(group, state);
  if (rows.length === 0) return null;
  const id = `group-${group.name}`;
  return (
    <section class="card" aria-labelledby={id} data-group={group.name}>
      <h2 id={id}>
        {group.title} {group.source && <span class="faint small">{group.source}</span>}
      </h2>
      <dl class="coverage-rows">
        {rows.map((row) => (
          <RowOfCells key={`${row.family} ${row.name} ${row.cells.length}`} row={row} campaigns={matrix.campaigns} />
        ))}
      </dl>
    </section>
  );
}
