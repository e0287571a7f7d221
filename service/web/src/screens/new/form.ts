/** What every part of the form shares: the values, the listeners to a change, and what the service says is wrong. */

import { createContext } from "preact";
import { useContext } from "preact/hooks";
import type { Body } from "../../api/types";
import type { Json, Values } from "./schema";
import { at, pathText, type Path } from "./values";

export type Wrong = Body<"FieldProblem">;

export interface Form {
  spec: Values;
  change: (path: Path, value: Json) => void;
  wrong: readonly Wrong[];
}

export const FormContext = createContext<Form>({ spec: {}, change: () => undefined, wrong: [] });

interface Bound<T> {
  id: string;
  value: T;
  change: (value: Json) => void;
  /** What is wrong with this field itself or, for one that shows its parts at once, with any of them. */
  wrong: readonly Wrong[];
}

export function useField<T extends Json = Json>(path: Path, withParts = false): Bound<T> {
  const { spec, change, wrong } = useContext(FormContext);
  const name = pathText(path);
  return {
    id: `field-${name}`,
    value: at(spec, path) as T,
    change: (value) => change(path, value),
    wrong: wrong.filter(({ field }) => field === name || (withParts && isWithin(field, name))),
  };
}

/** Whether a field lies in a part of the spec. */
export function isWithin(field: string, part: string): boolean {
  return field === part || field.startsWith(`${part}.`) || field.startsWith(`${part}[`);
}
