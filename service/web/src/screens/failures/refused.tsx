/** How many violations each rule refused; a bar filters by its rule. */

import { useMemo } from "preact/hooks";
import { tally } from "./filters";
import { refusal } from "../../ui/verdicts";
import type { FailureTable } from "./wire";

interface Props {
  table: FailureTable;
  all: readonly number[];
  chosen: string;
  choose: (rule: string) => void;
}

export function RefusedBy({ table, all, chosen, choose }: Props) {
  const rules = useMemo(() => tally(table, all, "rule"), [table, all]);
  const most = rules[0]?.[1] ?? 1;
  return (
    <section class="card plot" aria-label="Rules">
      <div class="plot-head">
        <h2>Why they do not count</h2>
        <p class="faint small">One violation may break several rules.</p>
      </div>
      <ul class="bars">
        {rules.map(([rule, count]) => (
          <li key={rule}>
            <button aria-pressed={rule === chosen} onClick={() => choose(rule === chosen ? "" : rule)}>
              <span class="bar-name">{refusal(rule)}</span>
              <span class="bar-line">
                <span class="bar-length" style={{ width: `${(100 * count) / most}%` }} />
              </span>
              <b>{count}</b>
            </button>
          </li>
        ))}
      </ul>
    </section>
  );
}
