/** What of the list is shown, by the API's own query parameters. */

import type { ComponentChildren } from "preact";
import type { Body } from "../../api/types";

const STATES: readonly Body<"State">[] = ["queued", "running", "paused", "cancelling", "cancelled", "succeeded", "failed"];
export const FILTERS = ["state", "family", "method", "label"] as const;
export type Filters = Partial<Record<(typeof FILTERS)[number], string>>;

export function filtersOf(query: URLSearchParams): Filters {
  return Object.fromEntries(FILTERS.flatMap((name) => (query.get(name) ? [[name, query.get(name)!]] : [])));
}

interface Choices {
  filters: Filters;
  families: readonly string[];
  methods: readonly string[];
  change: (changed: Filters) => void;
}

export function FilterBar({ filters, families, methods, change }: Choices) {
  const choice = (name: keyof Filters, title: string, options: readonly string[]) => (
    <Choice title={title} value={filters[name] ?? ""} options={options} choose={(value) => change({ ...filters, [name]: value })} />
  );
  return (
    <search class="row campaign-filters">
      {choice("state", "State", STATES)}
      {choice("family", "Family", families)}
      {choice("method", "Method", methods)}
      <Field title="Label">
        <input
          type="search"
          maxLength={200}
          placeholder="exactly so, then Enter"
          value={filters.label ?? ""}
          onChange={(event) => change({ ...filters, label: event.currentTarget.value })}
        />
      </Field>
      {Object.keys(filters).length > 0 && <button onClick={() => change({})}>All campaigns</button>}
    </search>
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
