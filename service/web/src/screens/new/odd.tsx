/** The operational design domain: a range for each of its fields, within what the chosen families support. */

import { useField } from "./form";
import { SchemaField, Wrongs } from "./field";
import { apart, hull, same, scaleOf, type Range } from "./range";
import { RangeInput } from "./range_input";
import type { Field, Shape } from "./schema";
import type { Body } from "../../api/types";
import { pathText, type Path } from "./values";

type Family = Body<"FamilyEntry">;
type Which = "odd" | "odd_limits";
type Behaviour = keyof Family["behaviours"];
const BEHAVIOUR: Path = ["odd", "dynamic", "behaviour"];

export function OddFields({ shape, families }: { shape: Shape; families: readonly Family[] }) {
  if (shape.kind !== "object") return null;
  if (families.length === 0) return <p class="help">Choose a shipped scenario: it says what there is to narrow. A scenario of your own has its domain in its document.</p>;
  return (
    <>
      {shape.fields.map((branch) => (
        <section key={branch.name} class="odd-branch">
          <h3>{branch.title}</h3>
          {branch.shape.kind === "object" &&
            branch.shape.fields.map((field) => {
              const path = ["odd", branch.name, field.name];
              if (field.shape.kind === "choice") return <SchemaField key={field.name} field={field} path={path} />;
              if (field.shape.kind === "list") return <SetField key={field.name} field={field} path={path} families={families} />;
              return <RangeField key={field.name} field={field} path={path} families={families} />;
            })}
        </section>
      ))}
    </>
  );
}

interface OfFamilies {
  field: Field;
  path: Path;
  families: readonly Family[];
}

function RangeField({ field, path, families }: OfFamilies) {
  const { id, value, change, wrong } = useField<{ low: number; high: number } | null>(path, true);
  const usual = each<Range>(behaving(families, useField<Behaviour>(BEHAVIOUR).value), path, "odd");
  const preset = hull(usual.map(([, range]) => range));
  const scale = scaleOf(hull(each<Range>(families, path, "odd_limits").map(([, range]) => range)), field.name === "lanes");
  if (usual.length === 0) return null;
  const range = value ?? preset;
  const missed = families.filter((family) => value && apart(value, each<Range>([family], path, "odd_limits")[0]![1]));
  return (
    <div class={wrong.length ? "odd-field is-wrong" : "odd-field"} id={id}>
      <div class="row odd-title">
        <b>{field.title}</b>
        {value && (
          <button type="button" class="reset" onClick={() => change(null)}>
            As the family has it
          </button>
        )}
      </div>
      {scale.low === scale.high && value === null ? (
        <p class="help">
          {`${scale.low} ${field.unit}`.trim()}, and nothing else is supported.
        </p>
      ) : (
        <RangeInput
          id={id}
          title={field.title}
          unit={field.unit}
          value={range}
          scale={scale}
          change={(next) => change(same(next, preset) ? null : { ...next })}
        />
      )}
      <Wrongs id={id} wrong={wrong} />
      {missed.length > 0 && wrong.length === 0 && <p class="wrong">Nothing is left of {missed.map(({ name }) => name).join(", ")}.</p>}
      <p class="help">
        {field.about} {usually(usual, field.unit)} <Narrowed families={families} path={path} />
      </p>
    </div>
  );
}

/** The families with the defaults of a behaviour, which their own are where it is not known yet. */
function behaving(families: readonly Family[], behaviour: Behaviour): Family[] {
  return families.map((family) => ({ ...family, odd: { ...family.odd, dynamic: family.behaviours[behaviour] ?? family.odd.dynamic } }));
}

/** What the default is; by family where they differ. */
function usually(usual: readonly [Family, Range][], unit: string): string {
  const said = ({ low, high }: Range) => (low === high ? `${low} ${unit}` : `${low} to ${high} ${unit}`).trim();
  const [[, first]] = usual as [[Family, Range]];
  if (usual.every(([, range]) => same(range, first))) return `Default: ${said(first)}.`;
  return `Default: ${usual.map(([family, range]) => `${family.name} ${said(range)}`).join(", ")}.`;
}

/** The scene parameters that the field bounds. */
function Narrowed({ families, path }: Pick<OfFamilies, "families" | "path">) {
  const field = pathText(path.slice(1));
  const bounded = families.flatMap(({ name, parameters }) =>
    parameters
      .filter(({ odd }) => odd === field)
      .map(({ name: parameter, low, high }) => `${families.length > 1 ? `${name}: ` : ""}${parameter} (${low} to ${high})`),
  );
  return bounded.length > 0 ? <span>Narrows {bounded.join(", ")}.</span> : null;
}

function SetField({ field, path, families }: OfFamilies) {
  const { id, value, change, wrong } = useField<string[] | null>(path, true);
  const all = (which: Which) => [...new Set(each<string[]>(families, path, which).flatMap(([, kinds]) => kinds))].sort();
  const [offered, usual] = [all("odd_limits"), all("odd")];
  const chosen = value ?? usual;
  const toggle = (kind: string) => {
    const next = offered.filter((other) => (other === kind) !== chosen.includes(other));
    change(next.join() === usual.join() ? null : next);
  };
  if (offered.length < 2 && value === null) return null;
  return (
    <fieldset class={wrong.length ? "odd-set is-wrong" : "odd-set"} id={id}>
      <legend>{field.title}</legend>
      <span class="row">
        {offered.map((kind) => (
          <label key={kind} class="check">
            <input type="checkbox" checked={chosen.includes(kind)} onChange={() => toggle(kind)} /> {kind.replaceAll("_", " ")}
          </label>
        ))}
      </span>
      <Wrongs id={id} wrong={wrong} />
      <p class="help">{field.about}</p>
    </fieldset>
  );
}

/** A field of each family's ODD, where it has one. */
function each<T>(families: readonly Family[], path: Path, which: Which): [Family, T][] {
  const [, branch, name] = path as [string, string, string];
  return families.flatMap((family) => {
    const found = (family[which] as unknown as Record<string, Record<string, T | null>>)[branch]?.[name];
    return found === null || found === undefined ? [] : [[family, found]];
  });
}
