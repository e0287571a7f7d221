/** One scenario: its picture, parameters, document and campaigns. */

import { useState } from "preact/hooks";
import { useAsked } from "../../api/asked";
import { save, send } from "../../api/client";
import type { Body } from "../../api/types";
import { address, go } from "../../router";
import { Confirm } from "../../ui/confirm";
import { pathOf, useScenarioPicture } from "../../ui/scenario";
import { Shown } from "../../ui/states";
import { count, moment } from "../../ui/text";
import { useTitle } from "../../ui/title";
import { titleOf } from "./listed";
import "./scenarios.css";

type Details = Body<"ScenarioDetails">;

export function ScenarioScreen({ name }: { name: string }) {
  useTitle(titleOf(name), "Scenarios");
  const asked = useAsked<Details>(pathOf(name));
  return (
    <Shown asked={asked} what="the scenario">
      {(scenario) => (
        <div class="scenarios grid">
          <Head scenario={scenario} />
          <div class="scenario-parts">
            <div class="grid">
              <Picture name={name} />
              <Parameters rows={scenario.parameters} />
              <Campaigns name={name} />
            </div>
            <section class="card" aria-label="Document">
              <h2>Document</h2>
              <pre class="document" tabIndex={0}>
                {scenario.document}
              </pre>
            </section>
          </div>
        </div>
      )}
    </Shown>
  );
}

function Head({ scenario: { name, summary, tags, shipped, created_at, actors, horizon_s, like, document } }: { scenario: Details }) {
  const [doubt, setDoubt] = useState(false);
  return (
    <>
      <div class="head">
        <span class="crumbs">
          <a href="#/scenarios">Scenarios</a>
        </span>
        <h1>{titleOf(name)}</h1>
        <div class="actions">
          <a class="button primary" href={address(["new"], { scenario: name })}>
            Start a campaign
          </a>
          <a class="button" href={address(["scenarios", "new"], { from: name })}>
            Edit a copy
          </a>
          <button onClick={() => save(new Blob([document]), `${name}.yaml`)}>Save as a file</button>
          {!shipped && (
            <button class="danger" onClick={() => setDoubt(true)}>
              Delete
            </button>
          )}
        </div>
      </div>
      <div>
        <p class="breaking">{summary}</p>
        <p class="row tags">
          {tags.map((tag) => (
            <a key={tag} class="tag" href={address(["scenarios"], { search: tag })}>
              {tag}
            </a>
          ))}
        </p>
        <p class="small faint breaking">
          <code>{name}</code> · {created_at ? `added ${moment(created_at)}` : "ships with the service"} · actors:{" "}
          {actors.join(", ") || "none"} · horizon {horizon_s}
          {typeof horizon_s === "number" && " s"}
          {like && ` · prior of ${like}`}
        </p>
      </div>
      {doubt && (
        <Confirm
          title={`Delete ${titleOf(name)}?`}
          verb="Delete for good"
          act={async () => {
            await send("DELETE", pathOf(name));
            go("#/scenarios");
          }}
          close={() => setDoubt(false)}
        >
          <p>The document and its networks are deleted. A scenario that a campaign names is kept.</p>
        </Confirm>
      )}
    </>
  );
}

function Picture({ name }: { name: string }) {
  const url = useScenarioPicture(name);
  return (
    <figure class="card scenario-picture">
      {url ? (
        <img src={url} alt="The scenario from above with the ranges of all starts" />
      ) : (
        <span class="faint">{url === null ? "Drawing …" : "There is no picture."}</span>
      )}
    </figure>
  );
}

function Parameters({ rows }: { rows: Details["parameters"] }) {
  return (
    <section class="card" aria-label="Parameters">
      <h2>Parameters</h2>
      {rows.length === 0 ? (
        <p class="faint">It has none.</p>
      ) : (
        <div class="scroll" tabIndex={0} role="region" aria-label="Table of parameters">
          <table>
            <thead>
              <tr>
                <th>Name</th>
                <th>Range</th>
                <th>Meaning</th>
              </tr>
            </thead>
            <tbody>
              {rows.map(({ name, unit, meaning, range, words }) => (
                <tr key={name}>
                  <td>
                    <code>{name}</code>
                  </td>
                  <td>{range ? `${range[0]} to ${range[1]} ${unit}` : (words ?? []).join(", ")}</td>
                  <td class="meaning">{meaning}</td>
                </tr>
              ))}
            </tbody>
          </table>
        </div>
      )}
    </section>
  );
}

const SHOWN = 10;

function Campaigns({ name }: { name: string }) {
  const asked = useAsked<Body<"CampaignPage">>(`v1/campaigns?${new URLSearchParams({ family: name, limit: String(SHOWN) })}`);
  return (
    <section class="card" aria-label="Campaigns">
      <h2>Campaigns</h2>
      <Shown asked={asked} what="its campaigns">
        {({ items, next }) =>
          items.length === 0 ? (
            <p class="faint">No campaign has searched it yet.</p>
          ) : (
            <>
              <ul class="scenario-campaigns">
                {items.map(({ id, label, state, progress }) => (
                  <li key={id}>
                    <a class="breaking" href={address(["campaigns", id])}>
                      {label || id}
                    </a>{" "}
                    <span class={`tag ${state}`}>{state}</span> <span class="small faint">{count(progress.failures)} valid failures</span>
                  </li>
                ))}
              </ul>
              {next !== null && <a href={address(["campaigns"], { family: name })}>All of them</a>}
            </>
          )
        }
      </Shown>
    </section>
  );
}
