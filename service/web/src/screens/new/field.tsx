/** A field of the form made from its schema, whatever it is. */

import type { ComponentChildren } from "preact";
import { useContext, useEffect, useState } from "preact/hooks";
import { setting, tagsOf } from "../../ui/text";
import { FormContext, isWithin, useField, type Wrong } from "./form";
import { numbersOf, numbersText } from "./numbers";
import type { Field, Json, Shape, Values } from "./schema";
import { blank, equal, filled, pathText, type Path } from "./values";

/** All fields of an object; objects among them become groups that open. */
export function Fields({ shape, path }: { shape: Shape; path: Path }) {
  if (shape.kind !== "object") return null;
  return (
    <div class="fields">
      {shape.fields.map((field) => (
        <SchemaField key={field.name} field={field} path={[...path, field.name]} />
      ))}
    </div>
  );
}

export function SchemaField({ field, path }: { field: Field; path: Path }) {
  const { value, change } = useField(path);
  const { shape, optional, title, about } = field;
  if (optional) return <Optional field={field} path={path} />;
  if (shape.kind === "object") {
    const changed = field.preset !== undefined && !equal(value, filled(shape, field.preset));
    return (
      <Group title={title} about={about || shape.about} path={path} changed={changed} reset={() => change(filled(shape, field.preset))}>
        <Fields shape={shape} path={path} />
      </Group>
    );
  }
  return <Leaf field={field} path={path} />;
}

/** A field that may be null: a switch beside it says whether it is there at all. */
function Optional({ field, path }: { field: Field; path: Path }) {
  const { id, value, change } = useField(path);
  const { shape, title, about, preset } = field;
  const there = value !== null;
  const begin = () => change(filled(shape, preset === null || preset === undefined ? blank(shape) : preset));
  return (
    <div class={shape.kind === "object" ? "optional whole" : "optional"}>
      <label class="check">
        <input id={`${id}-there`} type="checkbox" checked={there} onChange={() => (there ? change(null) : begin())} />
        {there ? title : `${title}: none`}
      </label>
      {about && (!there || shape.kind === "object") && <p class="help">{about}</p>}
      {there && (shape.kind === "object" ? <Fields shape={shape} path={path} /> : <Leaf field={{ ...field, title: `${title}, value` }} path={path} />)}
    </div>
  );
}

interface Grouped {
  title: string;
  about?: string;
  path: Path;
  changed?: boolean;
  reset?: () => void;
  open?: boolean;
  children: ComponentChildren;
}

/** A part of the form that opens; it does so by itself where something in it is wrong. */
export function Group({ title, about, path, changed, reset, open = false, children }: Grouped) {
  const { wrong } = useContext(FormContext);
  const broken = wrong.filter(({ field }) => isWithin(field, pathText(path))).length;
  const [opened, setOpened] = useState(open);
  const shown = opened || broken > 0;
  return (
    <details class="group" open={shown} onToggle={(event) => setOpened(event.currentTarget.open)}>
      <summary>
        <span class="group-title">{title}</span>
        {broken > 0 ? <span class="tag failed">{broken} wrong</span> : changed && <span class="tag running">changed</span>}
      </summary>
      {about && <p class="help">{about}</p>}
      {shown && children}
      {shown && changed && reset && (
        <button type="button" class="reset" onClick={reset}>
          Back to the defaults
        </button>
      )}
    </details>
  );
}

/** A label, its control, what it means and what is wrong with it. */
export function Labelled(props: { id: string; title: string; unit?: string; about?: string; wrong: readonly Wrong[]; children: ComponentChildren }) {
  const { id, title, unit, about, wrong, children } = props;
  return (
    <div class={wrong.length ? "field is-wrong" : "field"}>
      <label for={id}>{title}</label>
      <span class="control">
        {children}
        {unit && <span class="faint">{unit}</span>}
      </span>
      <Wrongs id={id} wrong={wrong} />
      {about && (
        <p class="help" id={`${id}-help`}>
          {about}
        </p>
      )}
    </div>
  );
}

export function Wrongs({ id, wrong }: { id: string; wrong: readonly Wrong[] }) {
  if (wrong.length === 0) return null;
  return (
    <p class="wrong" id={`${id}-wrong`} role="alert">
      {wrong.map(({ message }) => message).join("; ")}
    </p>
  );
}

/** What a screen reader says of a control. */
export function described(id: string, wrong: readonly Wrong[], about: string): Record<string, string | boolean | undefined> {
  const by = [wrong.length ? `${id}-wrong` : "", about ? `${id}-help` : ""].filter(Boolean).join(" ");
  return { "aria-invalid": wrong.length ? true : undefined, "aria-describedby": by || undefined };
}

function Leaf({ field, path }: { field: Field; path: Path }) {
  const { shape, title, unit, about } = field;
  const bound = useField(path, true);
  const help = [about, boundsOf(shape)].filter(Boolean).join(" ");
  if (shape.kind === "switch") return <Switch field={field} path={path} />;
  if (shape.kind === "list" && shape.item.kind === "choice") return <Choices field={field} path={path} />;
  return (
    <Labelled {...bound} title={title} unit={unit} about={help}>
      <Control shape={shape} {...bound} more={described(bound.id, bound.wrong, help)} />
    </Labelled>
  );
}

function boundsOf(shape: Shape): string {
  if (shape.kind !== "number") return "";
  const { low, high } = shape;
  if (Number.isFinite(low) && Number.isFinite(high)) return `${setting(low)} to ${high > 1e6 ? high.toExponential().replace("+", "") : setting(high)}.`;
  return Number.isFinite(low) ? `At least ${setting(low)}.` : "";
}

interface Controlled {
  shape: Shape;
  id: string;
  value: Json;
  change: (value: Json) => void;
  more: Record<string, string | boolean | undefined>;
}

function Control({ shape, id, value, change, more }: Controlled) {
  if (shape.kind === "number") return <NumberInput id={id} shape={shape} value={value as number | null} change={change} more={more} />;
  if (shape.kind === "list") {
    const written = shape.item.kind === "text" ? (value as string[]).join(", ") : numbersText(value as number[]);
    return <ListInput id={id} value={written} read={shape.item.kind === "text" ? tagsOf : numbersOf} change={change} more={more} />;
  }
  if (shape.kind === "choice") {
    return (
      <select id={id} value={value as string} onChange={(event) => change(event.currentTarget.value)} {...more}>
        {shape.options.map((option) => (
          <option key={option}>{option}</option>
        ))}
      </select>
    );
  }
  const most = shape.kind === "text" && Number.isFinite(shape.most) ? shape.most : undefined;
  return <input id={id} value={value as string} maxLength={most} onInput={(event) => change(event.currentTarget.value)} {...more} />;
}

type NumberShape = Extract<Shape, { kind: "number" }>;
type Numbered = Omit<Controlled, "shape" | "value"> & { shape: NumberShape; value: number | null };

export function NumberInput({ id, shape, value, change, more }: Numbered) {
  const [typed, setTyped] = useState({ text: "", number: null as number | null }); // its digits stay as they were written
  const bounds = { min: Number.isFinite(shape.low) ? shape.low : undefined, max: Number.isFinite(shape.high) ? shape.high : undefined };
  return (
    <input
      id={id}
      type="number"
      {...bounds}
      step={shape.integer ? 1 : "any"}
      value={value === null ? "" : value === typed.number ? typed.text : setting(value)}
      onInput={({ currentTarget: { value: text, valueAsNumber } }) => {
        const number = Number.isFinite(valueAsNumber) ? valueAsNumber : null;
        setTyped({ text, number });
        change(number);
      }}
      {...more}
    />
  );
}

type Listed = Omit<Controlled, "shape" | "value"> & { value: string; read: (text: string) => Json[] | null };

/** Numbers or words as one line of text; what cannot be read counts for nothing. */
function ListInput({ id, value, read, change, more }: Listed) {
  const [typed, setTyped] = useState<string>(); // while it is written, since `0-` is on the way to `0-4`
  return (
    <input
      id={id}
      value={typed ?? value}
      onInput={(event) => {
        const text = event.currentTarget.value;
        const values = read(text);
        setTyped(text);
        if (values !== null) change(values);
      }}
      onBlur={() => setTyped(undefined)}
      {...more}
    />
  );
}

function Switch({ field: { title, about }, path }: { field: Field; path: Path }) {
  const { id, value, change, wrong } = useField<boolean>(path);
  return (
    <div class="field">
      <label class="check">
        <input id={id} type="checkbox" checked={value} onChange={() => change(!value)} {...described(id, wrong, about)} /> {title}
      </label>
      <Wrongs id={id} wrong={wrong} />
      {about && (
        <p class="help" id={`${id}-help`}>
          {about}
        </p>
      )}
    </div>
  );
}

interface Offered {
  field: Field;
  path: Path;
  /** A word on each. */
  abouts?: Values;
  /** What each costs, in words. */
  costs?: Values;
  /** Those that are shown first; the others are folded away. Without it all are shown. */
  first?: readonly string[];
  /** What is offered, where the API's description has no list of it. */
  offers?: readonly string[];
  /** Leaves out what is not chosen and does not match. */
  matches?: (option: string) => boolean;
  /** The picture of each. */
  picture?: (option: string) => ComponentChildren;
  /** What those are that are folded away. */
  folded?: string;
  help?: string;
  /** Called when one was chosen or dropped. */
  changed?: () => void;
}

/** Some of a few names, each with a box. */
export function Choices({ field, path, abouts = {}, costs = {}, first, help, changed, offers, matches = () => true, picture, folded: kept = "" }: Offered) {
  const { id, value, change, wrong } = useField<string[]>(path, true);
  const offered = offers ? offers : field.shape.kind === "list" && field.shape.item.kind === "choice" ? field.shape.item.options : [];
  const options = [...new Set([...offered, ...value])]; // a clone may have what a form does not offer: a place of a map
  const toggle = (option: string) => options.filter((each) => (each === option) !== value.includes(each));
  const shown = first ? [...first.filter((each) => options.includes(each))] : options.filter((option) => value.includes(option) || matches(option));
  const folded = first ? options.filter((each) => !shown.includes(each)) : [];
  const picked = folded.filter((each) => value.includes(each)).length;
  const [opened, setOpened] = useState(picked > 0);
  useEffect(() => {
    if (picked > 0) setOpened(true); // by a preset
  }, [picked > 0]);
  const card = (option: string) => (
    <label key={option} class={value.includes(option) ? "choice-card on" : "choice-card"}>
      <input
        type="checkbox"
        aria-label={option}
        aria-describedby={abouts[option] ? `${id}-${option}` : undefined}
        checked={value.includes(option)}
        onChange={() => {
          change(toggle(option));
          changed?.();
        }}
      />
      <span>
        {picture?.(option)}
        <b>{option}</b>
        {costs[option] && <span class="tag cost">{costs[option] as string}</span>}
        {abouts[option] && (
          <span class="small" id={`${id}-${option}`}>
            {abouts[option] as string}
          </span>
        )}
      </span>
    </label>
  );
  return (
    <fieldset class={wrong.length ? "choices is-wrong" : "choices"} id={id}>
      <legend>{field.title}</legend>
      <Wrongs id={id} wrong={wrong} />
      {help && <p class="help">{help}</p>}
      {shown.map(card)}
      {folded.length > 0 && (
        <details class="more-choices" open={opened} onToggle={(event) => setOpened(event.currentTarget.open)}>
          <summary>
            {folded.length} more {kept}{picked > 0 && <span class="tag running">{picked} selected</span>}
          </summary>
          {opened && <div class="choice-grid">{folded.map(card)}</div>}
        </details>
      )}
    </fieldset>
  );
}
