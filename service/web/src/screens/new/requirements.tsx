/** What counts as a failure: the shipped requirements, and the user's own formulas over the published signals. */

import { useRef } from "preact/hooks";
import type { Body } from "../../api/types";
import { setting, words } from "../../ui/text";
import { NO_CONTACT } from "../../ui/violations";
import { Labelled, NumberInput, Wrongs, described } from "./field";
import { faultOf, inserted, pointed } from "./formula";
import { useField } from "./form";
import type { Shape, Values } from "./schema";
import { filled } from "./values";

type Signal = Body<"SignalEntry">;
type Family = Body<"FamilyEntry">;
interface Requirement extends Values {
  name: string;
  formula: string;
  scale: number | null;
  counts: Counts;
  shapes: boolean;
}
type Counts = Family["requirements"][number]["counts"];

/** An entry without a formula says what a shipped requirement counts as, and nothing else. */
function adjusts({ name, formula }: Requirement, shipped: readonly string[]): boolean {
  return formula === "" && shipped.includes(name);
}

interface Shown {
  /** Of one requirement. */
  shape: Shape;
  signals: readonly Signal[];
  families: readonly Family[];
}

export function Requirements({ shape, signals, families }: Shown) {
  const { value, change, wrong } = useField<Requirement[]>(["requirements"]);
  const last = useRef<HTMLTextAreaElement>(null);
  const shipped = sharedBy(families);
  const names = shipped.map((each) => each.name);
  const entry = (changed: Partial<Requirement> & { name: string }): Requirement => ({ ...(filled(shape, {}) as Requirement), formula: "", scale: 1, ...changed });
  const add = () => change([...value, entry({ name: firstFree(value.map((each) => each.name)) })]);
  const count = ({ name, counts: usual }: Family["requirements"][number], counts: Counts) => {
    const others = value.filter((each) => each.name !== name);
    change(counts === usual ? others : [...others, entry({ name, counts })]);
  };
  return (
    <>
      <p class="help">An episode that violates a requirement which counts as a failure is a failure; the others are measured and reported.</p>
      <Wrongs id="field-requirements" wrong={wrong} />
      <Shipped requirements={shipped} value={value} count={count} />
      <p class="help">Requirements of your own come on top. A formula looks back only, never ahead.</p>
      {value.map((each, index) =>
        adjusts(each, names) ? null : (
          <One key={index} index={index} shape={shape} last={last} remove={() => change(value.filter((_, i) => i !== index))} />
        ),
      )}
      <button type="button" onClick={add}>
        Add a requirement
      </button>
      <Given families={families} />
      <Signals signals={signals} insert={value.length > 0 ? (name) => insert(last.current, name) : undefined} />
    </>
  );
}

/** Those that all of the families have: a requirement that one of them lacks cannot be told apart there. */
function sharedBy(families: readonly Family[]): Family["requirements"] {
  const [first, ...others] = families;
  return first?.requirements.filter(({ name }) => others.every(({ requirements }) => requirements.some((each) => each.name === name))) ?? [];
}

interface ShippedProps {
  requirements: Family["requirements"];
  value: readonly Requirement[];
  count: (requirement: Family["requirements"][number], counts: Counts) => void;
}

function Shipped({ requirements, value, count }: ShippedProps) {
  if (requirements.length === 0) return null;
  return (
    <fieldset class="requirement">
      <legend>What counts already</legend>
      {requirements.map((requirement) => {
        const { name, counts } = requirement;
        const id = `counts-${name}`;
        return (
          <div key={name} class="counted">
            <label for={id}>{words(name)}</label>
            <CountsAs id={id} value={value.find((each) => each.name === name)?.counts ?? counts} disabled={name === NO_CONTACT} change={(next) => count(requirement, next)} />
          </div>
        );
      })}
    </fieldset>
  );
}

function CountsAs({ change, ...rest }: { id: string; value: Counts; disabled?: boolean; change: (counts: Counts) => void }) {
  return (
    <select {...rest} onChange={(event) => change(event.currentTarget.value as Counts)}>
      <option value="failure">counts as a failure</option>
      <option value="report">is only reported</option>
    </select>
  );
}

interface Single {
  index: number;
  shape: Shape;
  last: { current: HTMLTextAreaElement | null };
  remove: () => void;
}

function One({ index, shape, last, remove }: Single) {
  const path = ["requirements", index] as const;
  const name = useField<string>([...path, "name"]);
  const formula = useField<string>([...path, "formula"]);
  const scale = useField<number | null>([...path, "scale"]);
  const counts = useField<Counts>([...path, "counts"]);
  const shapes = useField<boolean>([...path, "shapes"]);
  const about = (field: string) => (shape.kind === "object" ? (shape.fields.find((each) => each.name === field)?.about ?? "") : "");
  const faults = formula.wrong.map(({ message }) => faultOf(message));
  return (
    <fieldset class="requirement">
      <legend>Requirement {index + 1}</legend>
      <Labelled {...name} title="Name">
        <input
          id={name.id}
          value={name.value}
          maxLength={40}
          onInput={(event) => name.change(event.currentTarget.value)}
          {...described(name.id, name.wrong, "")}
        />
      </Labelled>
      <div class={faults.length ? "field is-wrong" : "field"}>
        <label for={formula.id}>Formula</label>
        <textarea
          id={formula.id}
          class="formula"
          rows={2}
          maxLength={500}
          spellcheck={false}
          value={formula.value}
          placeholder="historically[0,1] (ego_braking_mps2 <= 6)"
          onFocus={(event) => (last.current = event.currentTarget)}
          onInput={(event) => formula.change(event.currentTarget.value)}
          aria-invalid={faults.length > 0 ? true : undefined}
          aria-describedby={faults.length > 0 ? `${formula.id}-wrong` : undefined}
        />
        <div id={`${formula.id}-wrong`} role="alert">
          {faults.map(({ column, why }) => (
            <div key={why} class="fault">
              {column !== null && (
                <pre tabIndex={0} aria-label={`Wrong at column ${column}`}>
                  {pointed(formula.value, column)}
                </pre>
              )}
              <p class="wrong">
                {column !== null && `Column ${column}: `}
                {why}
              </p>
            </div>
          ))}
        </div>
      </div>
      <Labelled {...scale} title="Scale" about={about("scale")}>
        <NumberInput
          id={scale.id}
          shape={{ kind: "number", integer: false, low: 0.001, high: 1e6 }}
          value={scale.value}
          change={scale.change}
          more={described(scale.id, scale.wrong, about("scale"))}
        />
      </Labelled>
      <Labelled {...counts} title="An episode that violates it" about={about("counts")}>
        <CountsAs id={counts.id} value={counts.value} change={counts.change} />
      </Labelled>
      <div class="field">
        <label class="check">
          <input id={shapes.id} type="checkbox" checked={shapes.value} onChange={() => shapes.change(!shapes.value)} /> Shapes the reward
        </label>
        <p class="help">{about("shapes")}</p>
      </div>
      <button type="button" class="danger" onClick={remove} aria-label={`Remove requirement ${index + 1}`}>
        Remove
      </button>
    </fieldset>
  );
}

/** What each family asks anyway; to read, and to write one's own by. */
function Given({ families }: { families: readonly Family[] }) {
  if (families.length === 0) return null;
  return (
    <details class="sub">
      <summary>The formulas that the default ego has to meet already</summary>
      {families.map((family) => (
        <div key={family.name}>
          <h4>{family.name}</h4>
          <dl class="given">
            {family.requirements.map(({ name, formula }) => (
              <div key={name}>
                <dt>{name}</dt>
                <dd>
                  <code>{formula}</code>
                </dd>
              </div>
            ))}
          </dl>
        </div>
      ))}
    </details>
  );
}

function Signals({ signals, insert }: { signals: readonly Signal[]; insert?: (name: string) => void }) {
  return (
    <details class="sub" open={insert !== undefined}>
      <summary>Signals that a formula may speak of</summary>
      <div class="scroll signals" tabIndex={0} role="region" aria-label="Signals">
        <table>
          <thead>
            <tr>
              <th>Signal</th>
              <th>Unit</th>
              <th>Range</th>
              <th>Meaning</th>
            </tr>
          </thead>
          <tbody>
            {signals.map(({ name, unit, low, high, meaning }) => (
              <tr key={name}>
                <td>
                  {insert ? (
                    <button type="button" class="insert" title="Put it into the formula" onClick={() => insert(name)}>
                      <code>{name}</code>
                    </button>
                  ) : (
                    <code>{name}</code>
                  )}
                </td>
                <td>{unit}</td>
                <td>
                  {setting(low)} to {setting(high)}
                </td>
                <td class="meaning">{meaning}</td>
              </tr>
            ))}
          </tbody>
        </table>
      </div>
    </details>
  );
}

/** Into the formula that was written last, where its cursor was. */
function insert(area: HTMLTextAreaElement | null, name: string): void {
  const into = area?.isConnected ? area : document.querySelector<HTMLTextAreaElement>("textarea.formula");
  if (!into) return;
  const [text, cursor] = inserted(into.value, name, into.selectionStart, into.selectionEnd);
  into.value = text;
  into.setSelectionRange(cursor, cursor);
  into.dispatchEvent(new Event("input", { bubbles: true }));
  into.focus();
}

function firstFree(taken: readonly string[]): string {
  for (let i = 1; ; i++) if (!taken.includes(`mine_${i}`)) return `mine_${i}`;
}
