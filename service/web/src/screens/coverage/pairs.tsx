/** Two scene parameters of one scenario together. */

import { useState } from "preact/hooks";
import type { Body } from "../../api/types";
import { words } from "../../ui/text";
import { CellTable } from "../campaign/matrix";
import { titleOf } from "../new/schema";

type Pair = Body<"CoveredPair">;

export function Pairs({ pairs }: { pairs: Pair[] }) {
  const [at, setAt] = useState(0);
  const { parameters, bins, played, failed } = pairs[at] ?? pairs[0]!;
  const families = [...new Set(pairs.map(({ family }) => family))];
  const cells = played.map((row, i) => row.map((all, j) => ({ played: all, failed: failed[i]![j]! })));
  return (
    <section class="card" aria-labelledby="pairs">
      <h2 id="pairs">Two parameters together</h2>
      <label class="row">
        Pair{" "}
        <select value={at} onChange={(event) => setAt(Number(event.currentTarget.value))}>
          {families.map((family) => (
            <optgroup key={family} label={words(family)}>
              {pairs.map((pair, place) => pair.family === family && (
                <option key={place} value={place}>
                  {pair.parameters.map((name) => titleOf(name)[0]).join(" and ")}
                </option>
              ))}
            </optgroup>
          ))}
        </select>
      </label>
      <CellTable of={[parameters[0], parameters[1]]} bins={[bins[0], bins[1]]} cells={cells} />
    </section>
  );
}
