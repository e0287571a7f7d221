/** What of the list is shown, by the API's own query parameters. */

import type { ComponentChildren } from "preact";
import { useEffect, useState } from "preact/hooks";
import type { Body } from "../../api/types";

const STATES: readonly Body<"State">[] = ["queued", "running", "paused", "cancelling", "cancelled", "succeeded", "failed"];
export const FILTERS = ["state", "family", "method", "tag", "search"] as const;
export type Filters = Partial<Record<(typeof FILTERS)[number], string>>;

export function filtersOf(query: URLSearchParams): Filters {
  return Object.fromEntries(FILTERS.flatMap((name) => (query.get(name) ? [[name, query.get(name)!]] : [])));
}

interface Choices {
  filters: Filters;
  families: readonly string[];
  methods: readonly string[];
  /** Of the campaigns that are shown. */
  tags: readonly string[];
  change: (changed: Filters) => void;
}

export function FilterBar({ filters, families, methods, tags, change }: Choices) {
  const choice = (name: keyof Filters, title: string, options: readonly string[]) => (
    <Choice title={title} value={filters[name] ?? ""} options={options} choose={(value) => change({ ...filters, [name]: value })} />
  );
  return (
    <search class="row campaign-filters">
      {choice("state", "State", STATES)}
      {choice("family", "Family", families)}
      {choice("method", "Method", methods)}
      {(tags.length > 0 || filters.tag) && choice("tag", "Tag", tags)}
      <Search text={filters.search ?? ""} search={(text) => change({ ...filters, search: text })} />
      {Object.keys(filters).length > 0 && <button onClick={() => change({})}>All campaigns</button>}
    </search>
  );
}

const TYPED_MS = 250; // without another letter, until it is searched

/** Searches while it is typed; the address may change it, too. */
function Search({ text, search }: { text: string; search: (text: string) => void }) {
  const [typed, setTyped] = useState(text);
  useEffect(() => setTyped(text), [text]);
  useEffect(() => {
    if (typed.trim() === text) return;
    const timer = setTimeout(() => search(typed.trim()), TYPED_MS);
    return () => clearTimeout(timer);
  }, [typed]);
  return (
    <Field title="Search">
      <input
        type="search"
        maxLength={200}
        placeholder="words of a label, or an id"
        value={typed}
        onInput={(event) => setTyped(event.currentTarget.value)}
      />
    </Field>
  );
}

function Choice(props: { title: string; value: string; options: readonly string[]; choose: (value: string) => void }) {
  const { title, value, options, choose } = props;
  const all = value === "" || options.includes(value) ? options : [...options, value]; // as the address has it
  return (
    <Field title={title}>
      <select value={value} onChange={(event) => choose(event.currentTarget.value)}>
        <option value="">any</option>
        {all.map((option) => (
          <option key={option} value={option}>
            {option}
          </option>
        ))}
      </select>
    </Field>
  );
}

function Field({ title, children }: { title: string; children: ComponentChildren }) {
  return (
    <label class="row campaign-filter">
      {title} {children}
    </label>
  );
}
