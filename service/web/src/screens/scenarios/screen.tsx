/** All scenarios as cards: those that ship, then the project's own. */

import { useAsked } from "../../api/asked";
import type { Body } from "../../api/types";
import { address, replace } from "../../router";
import { ScenarioPicture } from "../../ui/scenario";
import { Empty, Shown } from "../../ui/states";
import { count } from "../../ui/text";
import { useTitle } from "../../ui/title";
import { matching, titleOf, type Summary } from "./listed";
import "./scenarios.css";

export function ScenariosScreen({ query }: { query: URLSearchParams }) {
  useTitle("Scenarios");
  const asked = useAsked<Body<"ScenarioList">>("v1/scenarios");
  const text = query.get("search") ?? "";
  return (
    <div class="scenarios grid">
      <div class="head">
        <h1>Scenarios</h1>
        <div class="actions">
          <a class="button primary" href="#/scenarios/new">
            New scenario
          </a>
        </div>
      </div>
      <Shown asked={asked} what="the scenarios">
        {({ items }) => {
          const shown = matching(items, text);
          return (
            <>
              <search class="row">
                <label class="row">
                  Search{" "}
                  <input
                    type="search"
                    maxLength={200}
                    size={30}
                    placeholder="words of a name, summary or tag"
                    value={text}
                    onInput={(event) => replace(address(["scenarios"], { search: event.currentTarget.value }))}
                  />
                </label>
                <span class="faint" role="status">
                  {count(shown.length)} of {count(items.length)} scenarios
                </span>
              </search>
              {shown.length === 0 && <Empty>No scenario matches.</Empty>}
              <ul class="scenario-cards">
                {shown.map((scenario) => (
                  <Card key={scenario.name} scenario={scenario} />
                ))}
              </ul>
            </>
          );
        }}
      </Shown>
    </div>
  );
}

function Card({ scenario: { name, summary, tags, shipped } }: { scenario: Summary }) {
  return (
    <li class="card">
      <ScenarioPicture name={name} />
      <h2>
        <a href={address(["scenarios", name])}>{titleOf(name)}</a>
      </h2>
      <p class="breaking">{summary}</p>
      <p class="row tags">
        {!shipped && <span class="tag running">own</span>}
        {tags.map((tag) => (
          <a key={tag} class="tag" href={address(["scenarios"], { search: tag })}>
            {tag}
          </a>
        ))}
      </p>
    </li>
  );
}
