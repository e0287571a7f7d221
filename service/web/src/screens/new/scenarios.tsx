/** The scenarios of a campaign, chosen from the list that the screen of scenarios shows. */

import { useState } from "preact/hooks";
import type { Body } from "../../api/types";
import { matching } from "../scenarios/listed";
import { Choices } from "./field";
import type { Field } from "./schema";

const MANY = 6; // above it a search box helps

export function Scenarios({ field, items }: { field: Field; items: Body<"ScenarioList">["items"] }) {
  const [text, setText] = useState("");
  const matched = new Set(matching(items, text).map(({ name }) => name));
  return (
    <>
      {items.length > MANY && (
        <p class="row">
          <label class="row">
            Search scenarios{" "}
            <input type="search" value={text} placeholder="words of a name, summary or tag" onInput={(event) => setText(event.currentTarget.value)} />
          </label>
          <a href="#/scenarios">All scenarios with pictures</a>
        </p>
      )}
      <Choices
        field={{ ...field, title: "Scenarios" }}
        path={["families"]}
        offers={items.map(({ name }) => name)}
        abouts={Object.fromEntries(items.map(({ name, summary }) => [name, summary]))}
        matches={(name) => matched.has(name)}
      />
    </>
  );
}
