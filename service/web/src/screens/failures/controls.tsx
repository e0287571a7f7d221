/** The filters above the cards. */

import { useEffect, useMemo, useRef, useState } from "preact/hooks";
import { isNarrowed, tally, type Facet, type Filters } from "./filters";
import { FACET_LABELS, valueWords } from "./naming";
import type { FailureTable } from "./wire";

const TYPING_MS = 150;
const SHOWN: Record<Filters["tab"], readonly Facet[]> = {
  failures: ["requirement", "family", "method", "run", "grade", "severity", "fault", "prevented_by", "kind", "striker", "broke", "ego_broke", "triage"],
  refused: ["requirement", "family", "method", "run", "rule", "severity", "kind", "striker", "broke", "ego_broke"],
};

interface Props {
  table: FailureTable;
  /** All of the tab: what can be chosen from. */
  all: readonly number[];
  filters: Filters;
  change: (changed: Partial<Filters>) => void;
  resetAll: () => void;
}

export function Controls({ table, all, filters, change, resetAll }: Props) {
  return (
    <form class="failure-filters" role="search" aria-label="Filter failures" onSubmit={(event) => event.preventDefault()}>
      {SHOWN[filters.tab].map((facet) => (
        <FacetChoice key={facet} {...{ table, all, facet }} chosen={filters[facet]} choose={(value) => change({ [facet]: value })} />
      ))}
      <Search text={filters.q} change={(q) => change({ q })} />
      <button type="button" onClick={resetAll} disabled={!isNarrowed(filters)}>
        Reset
      </button>
    </form>
  );
}

interface FacetProps {
  table: FailureTable;
  all: readonly number[];
  facet: Facet;
  chosen: string;
  choose: (value: string) => void;
}

function FacetChoice({ table, all, facet, chosen, choose }: FacetProps) {
  const counts = useMemo(() => tally(table, all, facet), [table, all, facet]);
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

/** Text is looked for when the typing pauses; the address does not follow every key. */
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
        placeholder="hiding red"
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
