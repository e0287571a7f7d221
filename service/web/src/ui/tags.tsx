/** Tags of campaigns: chips that lead to the list of those with the tag, and a way to change them. */

import { useState } from "preact/hooks";
import { send } from "../api/client";
import { address } from "../router";
import { tagsOf } from "./text";
import "./tags.css";

/** Each leads to the list, with the filters that it has besides. */
export function Tags({ tags, filters = {} }: { tags: readonly string[]; filters?: Record<string, string | undefined> }) {
  if (tags.length === 0) return null;
  return (
    <span class="tag-links">
      {tags.map((tag) => (
        <a key={tag} class="tag tag-link" href={address(["campaigns"], { ...filters, tag })} aria-label={`Campaigns with the tag ${tag}`}>
          {tag}
        </a>
      ))}
    </span>
  );
}

/** The tags of a campaign, and a field to write others in their place. */
export function TagsEditor({ id, tags, again }: { id: string; tags: readonly string[]; again: () => void }) {
  const [text, setText] = useState<string>();
  const [refused, setRefused] = useState("");
  if (text === undefined) {
    return (
      <>
        <Tags tags={tags} />{" "}
        <button class="quiet" onClick={() => setText(tags.join(", "))}>
          {tags.length ? "Change tags" : "Add tags"}
        </button>
      </>
    );
  }
  const save = async (event: Event) => {
    event.preventDefault();
    try {
      await send("PUT", `v1/campaigns/${encodeURIComponent(id)}/tags`, { tags: tagsOf(text) });
      again();
      close();
    } catch (error) {
      setRefused((error as Error).message);
    }
  };
  const close = () => {
    setText(undefined);
    setRefused("");
  };
  return (
    <form class="row tags-form" onSubmit={save} onKeyDown={(event) => event.key === "Escape" && close()}>
      <input aria-label="Tags" aria-describedby="tags-said" value={text} placeholder="nightly, release:2.1" onInput={(event) => setText(event.currentTarget.value)} autofocus />
      <button class="primary">Save</button>
      <button type="button" onClick={close}>
        Cancel
      </button>
      <span id="tags-said" class={refused ? "bad breaking" : "small faint"} role={refused ? "alert" : undefined}>
        {refused || "Separated by spaces or commas, 10 at most."}
      </span>
    </form>
  );
}
