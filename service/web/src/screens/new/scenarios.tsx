/** The scenarios of a campaign, chosen from cards with pictures. */

import { useState } from "preact/hooks";
import type { Body } from "../../api/types";
import { ScenarioPicture } from "../../ui/scenario";
import { matching } from "../scenarios/listed";
import { Choices } from "./field";
import type { Field } from "./schema";

const SHOWN = 6; // the others are folded away until a search

export function Scenarios({ field, items }: { field: Field; items: Body<"ScenarioList">["items"] }) {
  const [text, setText] = useState("");
  const matched = new Set(matching(items, text).map(({ name }) => name));
  const names = items.map(({ name }) => name);
  return (
    <>
      {items.length > SHOWN && (
        <label class="row">
          Search scenarios{" "}
          <input type="search" value={text} placeholder="words of a name, summary or tag" onInput={(event) => setText(event.currentTarget.value)} />
        </label>
      )}
      <Choices
        field={{ ...field, title: "Scenarios" }}
        path={["families"]}
        offers={names}
        abouts={Object.fromEntries(items.map(({ name, summary }) => [name, summary]))}
        first={text ? undefined : names.slice(0, SHOWN)}
        matches={(name) => matched.has(name)}
        picture={(name) => names.includes(name) && <ScenarioPicture name={name} />}
        folded="scenarios"
      />
    </>
  );
}
