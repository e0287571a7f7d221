/** The ego under test: one that the service knows by name, and known faults to plant into it. */

import { useState } from "preact/hooks";
import { useAsked } from "../../api/asked";
import type { Body } from "../../api/types";
import { Shown } from "../../ui/states";
import { unused } from "./body";
import { Choices, Fields, Group, Labelled, described } from "./field";
import { useField } from "./form";
import type { Field, Shape, Values } from "./schema";

type Egos = Body<"Egos">;
type Defect = Egos["defects"][number];

const OTHER = "other";
const APART: readonly string[] = ["profile", "driver", "label", "defects"];
const OTHERS = "An ego of yours has a name here once the service registers it: an entry point module:Class, or the address of a remote one.";

interface Props {
  field: Field;
}

export function Ego({ field }: Props) {
  const known = useAsked<Egos>("v1/egos");
  const fields = partsOf(field);
  return (
    <section class="card ego" aria-labelledby="ego-title">
      <h2 id="ego-title">1. Ego</h2>
      <Shown asked={known} what="the egos">
        {(egos) => (
          <>
            <Driver egos={egos} />
            <Fields shape={{ kind: "object", about: "", fields: fields.filter(({ name }) => name === "label").map((label) => ({ ...label, title: "Version" })) }} path={["ego"]} />
            <Defects field={fields.find(({ name }) => name === "defects")!} egos={egos} />
          </>
        )}
      </Shown>
    </section>
  );
}

/** What else an ego has: its delay, and what it sees. */
export function Perception({ field, sent }: Props & { sent: Values }) {
  const { value: ego } = useField<Values>(["ego"]);
  const left = partsOf(field).filter(({ name }) => !APART.includes(name) && !unused(ego).includes(name));
  const changed = left.some(({ name }) => name in sent);
  return (
    <Group title="Delay and sight" path={["ego"]} changed={changed} open={changed}>
      <Fields shape={{ kind: "object", about: "", fields: left }} path={["ego"]} />
    </Group>
  );
}

function partsOf({ shape }: Field): Field[] {
  return shape.kind === "object" ? shape.fields : [];
}

function Driver({ egos }: { egos: Egos }) {
  const { value: ego, change } = useField<Values>(["ego"]);
  const { id, wrong } = useField(["ego", "driver"]);
  const [free, setFree] = useState(false);
  const driver = ego.driver as string | null;
  const known = egos.items.find(({ kind, name }) => (driver === null ? kind === "sumo" && name === ego.profile : kind !== "sumo" && name === driver));
  const named = free || !known;
  const drive = (next: Values) => {
    const defects = (ego.defects as string[]).filter((name) => fitting({ ...ego, ...next }, egos).some((defect) => defect.name === name));
    change({ ...ego, version: null, response_time_s: null, ...next, defects });
  };
  const choose = (value: string) => {
    setFree(value === OTHER);
    const chosen = egos.items.find((each) => value === valueOf(each));
    if (!chosen) drive({ driver: "" });
    else drive(chosen.kind === "sumo" ? { driver: null, profile: chosen.name } : { driver: chosen.name });
  };
  const about = named ? "" : known.summary;
  const group = (label: string, kinds: readonly string[]) => {
    const items = egos.items.filter(({ kind }) => kinds.includes(kind));
    return (
      items.length > 0 && (
        <optgroup label={label}>
          {items.map((each) => (
            <option key={each.name} value={valueOf(each)}>
              {each.name}
            </option>
          ))}
        </optgroup>
      )
    );
  };
  return (
    <div class="fields">
      <Labelled id="field-ego.profile" title="Driver" about={about} wrong={named ? [] : wrong}>
        <select id="field-ego.profile" value={named ? OTHER : valueOf(known)} onChange={(event) => choose(event.currentTarget.value)} {...described("field-ego.profile", [], about)}>
          {group("SUMO's driver", ["sumo"])}
          {group("Registered with the service", ["python", "remote"])}
          <option value={OTHER}>another, by its name</option>
        </select>
      </Labelled>
      {named && (
        <Labelled id={id} title="Name of the ego" about={OTHERS} wrong={wrong}>
          <input id={id} value={driver ?? ""} onInput={(event) => drive({ driver: event.currentTarget.value })} {...described(id, wrong, OTHERS)} />
        </Labelled>
      )}
    </div>
  );
}

function Defects({ field, egos }: { field: Field; egos: Egos }) {
  const { value: ego } = useField<Values>(["ego"]);
  const { change: setVersion } = useField(["ego", "version"]);
  const chosen = (ego.defects as string[]).length;
  const fit = fitting(ego, egos);
  const shape: Shape = { kind: "list", item: { kind: "choice", options: fit.map(({ name }) => name) }, least: 0, most: Infinity };
  const abouts = Object.fromEntries(fit.map(({ name, sentence, families }) => [name, `${sentence} In ${families.join(", ")}.`]));
  return (
    <Group title="Defects" about="Known faults to plant into the ego." path={["ego", "defects"]} changed={chosen > 0} open={chosen > 0}>
      {fit.length + chosen > 0 ? (
        <Choices field={{ ...field, shape }} path={["ego", "defects"]} abouts={abouts} changed={() => setVersion(null)} />
      ) : (
        <p class="help">A remote ego takes none: it runs in a process of its own.</p>
      )}
    </Group>
  );
}

/** Defects that an ego can have. */
function fitting(ego: Values, egos: Egos): Defect[] {
  const remote = egos.items.some(({ kind, name }) => kind === "remote" && name === ego.driver);
  return remote ? [] : egos.defects.filter(({ kind }) => (kind === "sumo") === (ego.driver === null));
}

function valueOf({ kind, name }: Egos["items"][number]): string {
  return `${kind === "sumo" ? "profile" : "driver"} ${name}`;
}
