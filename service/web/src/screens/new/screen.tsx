/** A new campaign in three choices, more settings made from the API's own description, and the same as text. */

import type { ComponentChildren } from "preact";
import { useMemo, useState } from "preact/hooks";
import { useAsked } from "../../api/asked";
import { call, Problem } from "../../api/client";
import type { Body } from "../../api/types";
import { address, go } from "../../router";
import { Shown } from "../../ui/states";
import { useTitle } from "../../ui/title";
import { bodyOf, textOf } from "./body";
import { useChecked } from "./checked";
import { Efforts } from "./effort";
import { Ego, Perception } from "./ego";
import { Choices, Fields, Group, SchemaField } from "./field";
import { FormContext, isWithin, type Wrong } from "./form";
import { grounded, groundOf, OnMap, useExtent, type Ground } from "./ground";
import { OddFields } from "./odd";
import { applied, EFFORTS, FIRST, isOf } from "./presets";
import { Preview } from "./preview";
import { Requirements } from "./requirements";
import { posted, type Description, type Field, type Json, type Shape, type Values } from "./schema";
import { Scenarios } from "./scenarios";
import { Submit } from "./submit";
import { LIKE, timesOf } from "./times";
import { filled, leaves, put, type Path } from "./values";
import "./new.css";

type Known = [Description, Body<"Families">, Body<"Methods">, Body<"ScenarioList">];

export function NewScreen({ query }: { query: URLSearchParams }) {
  useTitle("New campaign");
  const from = query.get("from");
  const ground = groundOf(query);
  const description = useAsked<Description>("openapi.json");
  const families = useAsked<Body<"Families">>("v1/families");
  const methods = useAsked<Body<"Methods">>("v1/methods");
  const scenarios = useAsked<Body<"ScenarioList">>("v1/scenarios");
  const scenario = query.get("scenario");
  const cloned = useAsked<Values>(from === null ? null : `v1/campaigns/${encodeURIComponent(from)}/spec?format=json`);
  return (
    <>
      <div class="head">
        <h1>{from === null ? "New campaign" : "New campaign, from another one"}</h1>
      </div>
      <Shown asked={description} what="the form">
        {(described) => (
          <Shown asked={families} what="the families">
            {(known) => (
              <Shown asked={methods} what="the methods">
                {(search) => (
                  <Shown asked={scenarios} what="the scenarios">
                    {(offered) => {
                      const given: Known = [described, known, search, offered];
                      if (from === null) {
                        return <CampaignForm key={JSON.stringify([ground, scenario])} known={given} ground={ground} scenario={scenario} />;
                      }
                      return (
                        <Shown asked={cloned} what="the campaign to begin with">
                          {(spec) => <CampaignForm key={from} known={given} from={{ id: from, spec }} ground={null} />}
                        </Shown>
                      );
                    }}
                  </Shown>
                )}
              </Shown>
            )}
          </Shown>
        )}
      </Shown>
    </>
  );
}

interface Begun {
  known: Known;
  from?: { id: string; spec: Values };
  /** Where on a map, if on one. */
  ground: Ground | null;
  /** The scenario to begin with. */
  scenario?: string | null;
}

function CampaignForm({ known: [description, known, methods, scenarios], from, ground, scenario }: Begun) {
  const shape = useMemo(() => posted(description, "/v1/campaigns"), [description]);
  const time = useMemo(() => timesOf(scenarios.items, Object.fromEntries(methods.items.map(({ name, episode_cost }) => [name, episode_cost]))), [scenarios, methods]);
  const extent = useExtent(ground);
  const searchedBy = (values: Values) => (ground ? Array<string>(extent ?? 1).fill(LIKE[ground.pattern]) : (values.families as string[]));
  const [spec, setSpec] = useState<Values>(() => {
    const empty = filled(shape, from?.spec ?? {}) as Values;
    const families = [scenario ?? FIRST];
    return from ? empty : applied(EFFORTS[0]!, { ...empty, families }, families, time);
  });
  const located = (values: Values) => (ground ? grounded(ground, values) : values);
  const body = useMemo(() => located(bodyOf(shape, spec)), [shape, spec]);
  const text = textOf(body);
  const verdict = useChecked(text);
  const { submit, refused, busy } = useSubmit(text);
  const wrong = verdict.state === "wrong" ? verdict.wrong : refused.text === text ? refused.wrong : [];
  const why = verdict.state === "wrong" && wrong.length === 0 ? verdict.why : refused.text === text ? refused.why : "";
  const change = (path: Path, value: Json) =>
    setSpec((before) => {
      const next = put(before, path, value) as Values;
      const effort = path[0] === "families" && EFFORTS.find((each) => isOf(each, before, searchedBy(before), time));
      return effort ? applied(effort, next, searchedBy(next), time) : next;
    });
  const form = useMemo(() => ({ spec, wrong, change }), [spec, wrong, extent]);
  const searched = searchedBy(spec);
  const chosen = ground ? [] : known.items.filter(({ name }) => (spec.families as string[]).includes(name));
  const field = fieldsOf(shape);
  const tally = (name: string) => leaves(body[name]);
  return (
    <FormContext.Provider value={form}>
      <form class="new" noValidate onSubmit={submit}>
        <div class="grid parts">
          {from && (
            <p class="card small">
              Begun with the spec of <a href={address(["campaigns", from.id])}>{from.id}</a>; the seeds are the same, so that an unchanged
              one finds the same.
            </p>
          )}
          <Ego field={field("ego")} />
          <section class="card">
            <h2>2. Scenarios</h2>
            {ground ? <OnMap ground={ground} extent={extent} /> : <Scenarios field={field("families")} items={scenarios.items} />}
          </section>
          <section class="card">
            <h2>3. Effort</h2>
            <Efforts shape={shape} spec={spec} scenarios={searched} time={time} located={located} choose={setSpec} />
          </section>
          <More wrong={wrong} begun={from !== undefined}>
            <section class="card">
              <SchemaField field={field("label")} path={["label"]} />
              <SchemaField field={field("tags")} path={["tags"]} />
              <Choices
                field={field("methods")}
                path={["methods"]}
                abouts={summaries(methods.items)}
                costs={costs(methods.items)}
                first={methods.items.filter(({ usual }) => usual).map(({ name }) => name)}
                folded="methods for comparisons"
                help={COST}
              />
              <SchemaField field={{ ...field("seeds"), about: "Each method is run once with each; 0-4 is five of them." }} path={["seeds"]} />
            </section>
            <section class="card">
              <h2>Budget of each run</h2>
              <Fields shape={field("budget").shape} path={["budget"]} />
            </section>
            <section class="card">
              <SchemaField field={{ ...field("iid"), title: "I.i.d. phase", about: aboutOf(field("iid")) }} path={["iid"]} />
            </section>
            <Perception field={field("ego")} sent={(body.ego ?? {}) as Values} />
            {!ground && (
              <Group title="Operational design domain" about={aboutOf(field("odd"))} path={["odd"]} changed={tally("odd") > 0} open={tally("odd") > 0}>
                <OddFields shape={field("odd").shape} families={chosen} />
              </Group>
            )}
            <Group title="Requirements" path={["requirements"]} changed={tally("requirements") > 0} open={tally("requirements") > 0}>
              <Requirements shape={itemOf(field("requirements").shape)} signals={known.signals} families={chosen} />
            </Group>
            <Group title="Prior" path={["prior"]} changed={tally("prior") > 0} open={tally("prior") > 0}>
              <SchemaField field={{ ...field("prior"), title: "Start from" }} path={["prior"]} />
            </Group>
            <Group title="Learner" about={aboutOf(field("learner"))} path={["learner"]} changed={tally("learner") > 0} open={tally("learner") > 0}>
              <Fields shape={field("learner").shape} path={["learner"]} />
            </Group>
          </More>
        </div>
        <aside class="grid beside" aria-label="What it comes to">
          <Submit spec={spec} scenarios={searched} time={time} onMap={ground !== null} verdict={verdict} wrong={wrong} refused={why} busy={busy} />
          <Preview body={body} />
        </aside>
      </form>
    </FormContext.Provider>
  );
}

const CHOSEN = ["families", "network", "pattern", "place", "places", "ego.driver", "ego.label", "ego.defects"];

/** All that the three choices leave; it opens by itself where something in it is wrong. */
function More({ wrong, begun, children }: { wrong: readonly Wrong[]; begun: boolean; children: ComponentChildren }) {
  const [opened, setOpened] = useState(begun);
  const broken = wrong.filter(({ field }) => !CHOSEN.some((part) => isWithin(field, part))).length;
  const shown = opened || broken > 0;
  return (
    <details class="more-settings" open={shown} onToggle={(event) => setOpened(event.currentTarget.open)}>
      <summary>
        <span class="group-title">More settings</span>
        <span class="faint small">label, tags, methods, seeds, budget, operational design domain, requirements, learner</span>
        {broken > 0 && <span class="tag failed">{broken} wrong</span>}
      </summary>
      {shown && <div class="grid parts">{children}</div>}
    </details>
  );
}

const NOTHING = { text: "", wrong: [] as readonly Wrong[], why: "" };

/** Posts the text under a key of the form's own, so that a second try after a lost answer gets the same campaign. */
function useSubmit(text: string) {
  const [key, setKey] = useState(newKey);
  const [busy, setBusy] = useState(false);
  const [refused, setRefused] = useState(NOTHING);
  const submit = async (event: Event) => {
    event.preventDefault();
    setBusy(true);
    setRefused(NOTHING);
    try {
      const headers = { "Content-Type": "application/json", "Idempotency-Key": key };
      const answer = await call("v1/campaigns", { method: "POST", headers, body: text });
      const { id } = (await answer.json()) as Body<"Campaign">;
      go(address(["campaigns", id]));
    } catch (error) {
      const problem = error instanceof Problem ? error : undefined;
      if (problem?.status === 409) setKey(newKey()); // an earlier try came through, with other values
      setRefused({ text, wrong: problem?.errors ?? [], why: problem?.errors.length ? "" : wordsOf(error as Error) });
      setBusy(false);
    }
  };
  return { submit, refused, busy };
}

function wordsOf(error: Error): string {
  if (error instanceof TypeError) return "The service does not answer. Trying again cannot start it twice.";
  if (error instanceof Problem && error.status === 409) {
    return "An earlier try did start a campaign; see the list. Press again to start this one too.";
  }
  return error.message;
}

function newKey(): string {
  return Array.from(crypto.getRandomValues(new Uint8Array(16)), (byte) => byte.toString(16).padStart(2, "0")).join("");
}

function fieldsOf(shape: Shape): (name: string) => Field {
  const fields = shape.kind === "object" ? shape.fields : [];
  return (name) => {
    const found = fields.find((field) => field.name === name);
    if (!found) throw new Error(`the service's description of a campaign has no ${name}`);
    return found;
  };
}

function aboutOf({ shape }: Field): string {
  return shape.kind === "object" ? shape.about : "";
}

function itemOf(shape: Shape): Shape {
  return shape.kind === "list" ? shape.item : shape;
}

const COST = "The cost is the measured processor time of an episode as a multiple of one of random. Learners begin with a warm start, which costs less.";

/** What an episode of each method costs, in words. */
function costs(items: Body<"Methods">["items"]): Values {
  return Object.fromEntries(items.flatMap(({ name, episode_cost: cost }) => (cost === null ? [] : [[name, `cost ${cost}`]])));
}

function summaries(items: readonly { name: string; summary: string }[]): Values {
  return Object.fromEntries(items.map(({ name, summary }) => [name, summary]));
}
