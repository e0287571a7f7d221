/** An attribute with its values as chips; a chosen one tells what is behind it. */

import { useId, useState } from "preact/hooks";
import { address } from "../../router";
import { words } from "../../ui/text";
import { titleOf } from "../new/schema";
import { STATES, numbersOf, type Cell, type Matrix, type Row } from "./cells";

type Campaigns = Matrix["campaigns"];

export function RowOfCells({ row, campaigns }: { row: Row; campaigns: Campaigns }) {
  const [chosen, setChosen] = useState<string>();
  const id = useId();
  const cell = row.cells.find(({ name }) => name === chosen);
  const name = row.family ? titleOf(row.name)[0] : words(row.name); // a parameter's ends in its unit
  const unit = row.unit && `, ${row.unit}`;
  return (
    <div>
      <dt title={row.meaning}>
        {name}
        <span class="faint small">
          {unit}
          {row.family && ` in ${words(row.family)}`}
        </span>
      </dt>
      <dd>
        <div class="chips">
          {row.cells.length === 0 && <span class="faint small">no campaign has one</span>}
          {row.cells.map((each) => (
            <button
              key={each.name}
              class={`chip cell-${each.state}`}
              aria-expanded={each === cell}
              aria-controls={id}
              onClick={() => setChosen(each.name === chosen ? undefined : each.name)}
            >
              <span aria-hidden="true">{STATES[each.state][1]}</span> {words(each.name)} <span class="hidden-label">{STATES[each.state][0]}</span>
              <small>{numbersOf(each)}</small>
            </button>
          ))}
        </div>
        <div id={id} class="small" role="status">
          {cell && <Details cell={cell} meaning={row.meaning} campaigns={campaigns} />}
        </div>
      </dd>
    </div>
  );
}

function Details({ cell, meaning, campaigns }: { cell: Cell; meaning: string; campaigns: Campaigns }) {
  return (
    <div class="behind">
      <p>
        <b>{words(cell.name)}</b>: {cell.note}. {meaning && <span class="faint">{meaning}.</span>}
      </p>
      {cell.families.length > 0 && <p>In {cell.families.map(words).join(", ")}.</p>}
      {cell.campaigns.length > 0 && (
        <ul aria-label="Campaigns behind it">
          {cell.campaigns.map((id) => (
            <li key={id}>
              <a href={address(["campaigns", id])}>{campaigns.find((campaign) => campaign.id === id)?.label || id}</a>
              {cell.failing.includes(id) && (
                <>
                  {" "}
                  (<a href={address(["campaigns", id, "failures"])}>failures</a>)
                </>
              )}
            </li>
          ))}
        </ul>
      )}
    </div>
  );
}
