/** The filters above the cards. */

import { useEffect, useMemo, useRef, useState } from "preact/hooks";
import { isNarrowed, tally, type By, type Facet, type Filters } from "./filters";
import { FACET_LABELS, valueWords } from "./naming";
import type { FailureTable } from "./wire";

const TYPING_MS = 150;
const FIRST: Record<Filters["tab"], readonly Facet[]> = {
  failures: ["plausibility", "severity", "fault", "grade", "driven_by", "method", "family"],
  refused: ["rule", "severity", "driven_by", "method", "family"],
};
const MORE: Record<Filters["tab"], readonly Facet[]> = {
  failures: ["requirement", "kind", "striker", "prevented_by", "broke", "ego_broke", "run", "triage"],
  refused: ["requirement", "kind", "striker", "broke", "ego_broke", "run"],
};

interface Props {
  table: FailureTable;
  /** All of the tab: what can be chosen from. */
  episodes: readonly number[];
  /** What is counted. */
  by: By;
  filters: Filters;
  change: (changed: Partial<Filters>) => void;
  resetAll: () => void;
}

export function Controls({ table, episodes, by, filters, change, resetAll }: Props) {
  const more = MORE[filters.tab];
  const [open, setOpen] = useState(() => more.some((facet) => filters[facet]));
  const choice = (facet: Facet) => (
    <FacetChoice key={facet} {...{ table, episodes, by, facet }} chosen={filters[facet]} choose={(value) => change({ [facet]: value })} />
  );
  return (
    <form class="failure-filters" role="search" aria-label="Filter failures" onSubmit={(event) => event.preventDefault()}>
      {FIRST[filters.tab].map(choice)}
      <Search text={filters.q} change={(q) => change({ q })} />
      <button type="button" aria-expanded={open} onClick={() => setOpen(!open)}>
        {open ? "Fewer filters" : "More filters"}
      </button>
      <button type="button" onClick={resetAll} disabled={!isNarrowed(filters)}>
        Reset
      </button>
      {open && <div class="more-filters">{more.map(choice)}</div>}
    </form>
  );
}

interface FacetProps {
  table: FailureTable;
  episodes: readonly number[];
  by: By;
  facet: Facet;
  chosen: string;
  choose: (value: string) => void;
}

function FacetChoice({ table, episodes, by, facet, chosen, choose }: FacetProps) {
  const counts = useMemo(() => tally(table, episodes, facet, by), [table, episodes, facet, by]);
  const known = counts.some(([value]) => value === chosen);
  return (
    <label data-on={chosen ? true : undefined}>
      <span>{FACET_LABELS[facet]}</span>
      <select value={chosen} onChange={(event) => choose(event.currentTarget.value)}>
        <option value="">any</option>
        {chosen && !known && <option value={chosen}>{valueWords(facet, chosen)} (0)</option>}
        {counts.map(([value, count]) => (
          <option key={value} value={value}>
            {valueWords(facet, value)} ({count})
          </option>
        ))}
      </select>
    </label>
  );
}

/** Searches when the typing pauses, so that the address does not follow every key. */
function Search({ text, change }: { text: string; change: (text: string) => void }) {
  const [typed, setTyped] = useState(text);
  const timer = useRef<ReturnType<typeof setTimeout>>();
  useEffect(() => setTyped(text), [text]);
  useEffect(() => () => clearTimeout(timer.current), []);
  return (
    <label class="search" data-on={text ? true : undefined}>
      <span>Text</span>
      <input
        type="search"
        value={typed}
        placeholder="such as red"
        onInput={(event) => {
          const next = event.currentTarget.value;
          setTyped(next);
          clearTimeout(timer.current);
          timer.current = setTimeout(() => change(next), TYPING_MS);
        }}
      />
    </label>
  );
}
