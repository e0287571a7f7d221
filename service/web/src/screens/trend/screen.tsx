/** An ego over its versions: a table to choose from, and a chart of each figure. */

import { useState } from "preact/hooks";
import { useAsked } from "../../api/asked";
import type { Body } from "../../api/types";
import { address, replace } from "../../router";
import { byWeight, type Requirements } from "../../ui/requirements";
import { Empty, Shown } from "../../ui/states";
import { count, moment, percent, words } from "../../ui/text";
import { useTitle } from "../../ui/title";
import { VersionChart } from "./chart";
import { KindsTable } from "./kinds";
import { boxKey, boxesIn, changeOf, drawnIn, nameOf, rateOf, spots, type Point, type Row } from "./points";
import "./trend.css";

type Trend = Body<"Trend">;

export function TrendScreen({ query }: { query: URLSearchParams }) {
  useTitle("Versions");
  const egos = useAsked<Body<"Egos">>("v1/egos");
  return (
    <div class="trend grid">
      <div class="head">
        <h1>Versions of an ego</h1>
        <span class="faint">A campaign names the version as the ego's label. Campaigns are compared with those on the same terms alone.</span>
      </div>
      <Shown asked={egos} what="the egos">
        {({ items }) => {
          const names = items.map(({ name }) => name);
          const ego = query.get("ego") ?? names[0]!;
          const known = names.includes(ego) ? names : [ego, ...names]; // one that was registered once
          return (
            <>
              <label class="row">
                Ego{" "}
                <select value={ego} onChange={(event) => replace(address(["trend"], { ego: event.currentTarget.value }))}>
                  {known.map((name) => (
                    <option key={name}>{name}</option>
                  ))}
                </select>
              </label>
              <OfEgo key={ego} ego={ego} query={query} />
            </>
          );
        }}
      </Shown>
    </div>
  );
}

/** The campaigns of an ego on each set of terms, and the chosen ones compared. */
function OfEgo({ ego, query }: { ego: string; query: URLSearchParams }) {
  const path = `v1/egos/${encodeURIComponent(ego)}/trend`;
  const asked = useAsked<Trend>(path);
  const at = Number(query.get("row") ?? 0);
  const chosen = query.get("campaigns")?.split(",").filter(Boolean) ?? [];
  return (
    <Shown asked={asked} what="its campaigns">
      {({ rows, left_out }) => {
        const row = rows[at] ?? rows[0];
        if (!row) {
          return (
            <Empty>
              No campaign of {ego} has succeeded. <a href="#/new">Post one</a>
            </Empty>
          );
        }
        const ids = chosen.length ? chosen : row.points.map(({ campaign_id }) => campaign_id);
        const choose = (next: string[]) => replace(address(["trend"], { ego, row: at ? String(at) : "", campaigns: next.length === row.points.length ? "" : next.join(",") }));
        return (
          <>
            <Terms ego={ego} rows={rows} row={row} />
            <Versions row={row} chosen={ids} choose={choose} />
            {chosen.length ? <Chosen path={path} ids={chosen} /> : <Charts row={row} />}
            {left_out.length > 0 && <LeftOut left={left_out} />}
          </>
        );
      }}
    </Shown>
  );
}

function Terms({ ego, rows, row }: { ego: string; rows: Row[]; row: Row }) {
  return (
    <section class="card" aria-labelledby="terms">
      <h2 id="terms">Terms</h2>
      <div class="scroll" tabIndex={0} role="region" aria-label="Terms of the campaigns">
        <table>
          <thead>
            <tr>
              <th scope="col">Scenarios</th>
              <th scope="col">Methods</th>
              <th scope="col" class="number">Seeds</th>
              <th scope="col" class="number">Episodes</th>
              <th scope="col" class="number">Fresh scenes</th>
              <th scope="col">Behaviour</th>
              <th scope="col" class="number">Versions</th>
              <th scope="col">Differs from the first in</th>
            </tr>
          </thead>
          <tbody>
            {rows.map((each, at) => (
              <tr key={at} aria-current={each === row ? "true" : undefined}>
                <th scope="row">
                  <a href={address(["trend"], { ego, row: at ? String(at) : "" })}>{each.families.map(words).join(", ")}</a>
                </th>
                <td>{each.methods.join(", ")}</td>
                <td class="number">{count(each.seeds)}</td>
                <td class="number">{count(each.budget.episodes)}</td>
                <td class="number">{each.iid_episodes === null ? "–" : count(each.iid_episodes)}</td>
                <td>{each.behaviour}</td>
                <td class="number">{count(each.points.length)}</td>
                <td class="wraps small">{each.differs.join(", ") || "–"}</td>
              </tr>
            ))}
          </tbody>
        </table>
      </div>
    </section>
  );
}

function Versions({ row, chosen, choose }: { row: Row; chosen: string[]; choose: (ids: string[]) => void }) {
  const ids = row.points.map(({ campaign_id }) => campaign_id);
  const size = (kinds: readonly string[] | null) => (kinds === null ? "–" : count(kinds.length));
  return (
    <section class="card" aria-labelledby="versions">
      <h2 id="versions">Versions</h2>
      <div class="scroll" tabIndex={0} role="region" aria-label="Versions, oldest first">
        <table>
          <thead>
            <tr>
              <th scope="col">Version</th>
              <th scope="col">Campaign</th>
              <th scope="col" class="number">Headline</th>
              <th scope="col" class="number">New</th>
              <th scope="col" class="number">Gone</th>
              <th scope="col" class="number">Returned</th>
              <th scope="col">Not comparable with the one before</th>
            </tr>
          </thead>
          <tbody>
            {row.points.map((point, at) => {
              const id = point.campaign_id;
              const change = (yes: boolean) => choose(ids.filter((each) => (each === id ? yes : chosen.includes(each))));
              return (
                <tr key={id} data-version={point.version} data-changed={point.changed.join(" ") || undefined}>
                  <th scope="row">
                    <label class="row">
                      <input type="checkbox" checked={chosen.includes(id)} disabled={chosen.length === 1 && chosen[0] === id} onChange={(event) => change(event.currentTarget.checked)} />
                      <span class="breaking">{nameOf(point)}</span>
                    </label>
                  </th>
                  <td>
                    <a href={address(["campaigns", id])}>{point.at ? moment(point.at) : id}</a>
                    {point.earlier.length > 0 && <span class="faint small"> and {count(point.earlier.length)} before</span>}
                  </td>
                  <td class="number">{point.headline === null ? "–" : count(point.headline)}</td>
                  <td class="number">{size(point.new)}</td>
                  <td class="number">{size(point.gone)}</td>
                  <td class="number">{size(point.returned)}</td>
                  <td class="wraps small">{changeOf(row.points, at) || "–"}</td>
                </tr>
              );
            })}
          </tbody>
        </table>
      </div>
      <p class="faint small">Gone is what the search did not find again; that is no proof that it was mended. A regression plays the old failures against the new version.</p>
    </section>
  );
}

/** Asked of the service, which compares the chosen versions with each other. */
function Chosen({ path, ids }: { path: string; ids: string[] }) {
  const asked = useAsked<Trend>(`${path}?${new URLSearchParams(ids.map((id) => ["campaign", id]))}`);
  return (
    <Shown asked={asked} what="the chosen versions">
      {({ rows }) => (rows.length ? rows.map((row, at) => <Charts key={at} row={row} />) : <Empty>None of the chosen campaigns has succeeded.</Empty>)}
    </Shown>
  );
}

function Charts({ row }: { row: Row }) {
  const draws = drawnIn(row);
  const [draw, setDraw] = useState(draws[0] ?? "");
  const requirements: Requirements = Object.assign({}, ...row.points.map((point) => point.requirements));
  const of = (valueOf: Parameters<typeof spots>[1]) => spots(row.points, valueOf);
  const names = byWeight(requirements).map(([name]) => name);
  const rate = (point: Point, name: string | null) => rateOf(point, draw, name);
  return (
    <>
      {draws.length > 1 && (
        <label class="row">
          Rates in{" "}
          <select value={draw} onChange={(event) => setDraw(event.currentTarget.value)}>
            {draws.map((name) => (
              <option key={name}>{name}</option>
            ))}
          </select>
        </label>
      )}
      <div class="version-charts">
        <VersionChart title="Headline kinds" about="plausible, preventable, not minor, verified" spots={of((point) => point.headline)} say={count} />
        {draws.length > 0 && <VersionChart title="Failure rate" about={`of fresh scenes, 95 % interval: ${draw}`} spots={of((point) => rate(point, null))} say={percent} />}
        {boxesIn(row).map((box) => (
          <VersionChart key={box} title="Boundary area" about={`share of the box, 95 % interval: ${box}`} spots={of((point) => point.areas.find((area) => boxKey(area) === box))} say={percent} />
        ))}
      </div>
      <KindsTable row={row} />
      {names.length > 0 && (
        <section class="grid" aria-labelledby="by-requirement">
          <h2 id="by-requirement">By requirement</h2>
          <div class="version-charts">
            {names.map((name) => (
              <VersionChart
                key={name}
                title={words(name)}
                about={draws.length ? "rate in fresh scenes, 95 % interval" : requirements[name]!.counts === "failure" ? "kinds that the searches found" : "episodes of the searches, reported only"}
                spots={of((point) => (draws.length ? rate(point, name) : found(point.requirements[name])))}
                say={draws.length ? percent : count}
              />
            ))}
          </div>
        </section>
      )}
    </>
  );
}

function found(counts: Requirements[string] | undefined): number | null {
  if (!counts) return null;
  return counts.counts === "failure" ? counts.distinct : counts.violated;
}

function LeftOut({ left }: { left: Trend["left_out"] }) {
  return (
    <details class="card small">
      <summary>{left.length === 1 ? "1 campaign is" : `${count(left.length)} campaigns are`} left out</summary>
      <ul>
        {left.map(({ campaign_id, reason }) => (
          <li key={campaign_id}>
            <a href={address(["campaigns", campaign_id])}>{campaign_id}</a>: {reason}
          </li>
        ))}
      </ul>
    </details>
  );
}
