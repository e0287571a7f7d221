/** A scenario document as text: written, checked while it is typed, and saved. */

import { useEffect, useState } from "preact/hooks";
import { useAsked } from "../../api/asked";
import { call, Problem } from "../../api/client";
import type { Body } from "../../api/types";
import { address, go, replace } from "../../router";
import { pathOf } from "../../ui/scenario";
import { Shown } from "../../ui/states";
import { useTitle } from "../../ui/title";
import { checking, titleOf } from "./listed";
import { Said, type Verdict } from "./said";
import "./scenarios.css";

const PAUSE_MS = 800; // after the last key; a check plays 20 scenes
const YAML = "application/yaml";
const MOST_CHARS = 200_000; // a file with more is no document that a person edits

export function EditorScreen({ query }: { query: URLSearchParams }) {
  useTitle("New scenario", "Scenarios");
  const from = query.get("from");
  const listed = useAsked<Body<"ScenarioList">>("v1/scenarios");
  const begun = useAsked<Body<"ScenarioDetails">>(from === null ? null : pathOf(from));
  return (
    <div class="scenarios grid">
      <div class="head">
        <span class="crumbs">
          <a href="#/scenarios">Scenarios</a>
        </span>
        <h1>New scenario</h1>
        <label class="row">
          Begin with{" "}
          <select
            value={from ?? ""}
            onChange={(event) => replace(address(["scenarios", "new"], { from: event.currentTarget.value || undefined }))}
          >
            <option value="">an empty document</option>
            {(listed.value?.items ?? []).map(({ name }) => (
              <option key={name} value={name}>
                {titleOf(name)}
              </option>
            ))}
          </select>
        </label>
      </div>
      {from === null ? (
        <Editor key="" document="" />
      ) : (
        <Shown asked={begun} what="the document">
          {({ document }) => <Editor key={from} document={document} />}
        </Shown>
      )}
    </div>
  );
}

function Editor({ document }: { document: string }) {
  const [text, setText] = useState(document);
  const verdict = useChecked(text);
  const [refused, setRefused] = useState<Verdict | null>(null);
  const [busy, setBusy] = useState(false);
  const change = (next: string) => {
    setRefused(null);
    setText(next);
  };
  const post = async (body: BodyInit, type: string) => {
    setBusy(true);
    setRefused(null);
    try {
      const kept = (await (await posted("v1/scenarios", body, type)).json()) as Body<"ScenarioDetails">;
      go(address(["scenarios", kept.name]));
    } catch (error) {
      setRefused(wrongOf(error as Error));
      setBusy(false);
    }
  };
  const open = async (file: File | undefined) => {
    if (!file) return;
    if (await isZip(file)) return post(file, "application/zip");
    if (file.size > MOST_CHARS) return setRefused({ state: "wrong", wrong: [], why: "The file is too large for a document." });
    change(await file.text());
  };
  return (
    <form
      class="scenario-edit"
      onSubmit={(event) => {
        event.preventDefault();
        post(text, YAML);
      }}
    >
      <section class="card">
        <label for="scenario-document">Document, as YAML or JSON</label>
        <textarea
          id="scenario-document"
          class="document"
          spellcheck={false}
          rows={32}
          value={text}
          aria-describedby="scenario-verdict"
          onInput={(event) => change(event.currentTarget.value)}
        />
        <label class="scenario-file small">
          Or a file: a document to edit, or a zip archive of one with its networks, or of OpenSCENARIO files with their roads; an
          archive is saved at once{" "}
          <input type="file" accept=".yaml,.yml,.json,.zip" onChange={(event) => open(event.currentTarget.files?.[0])} />
        </label>
      </section>
      <aside class="card" aria-label="Check">
        <button class="primary" disabled={busy || text.trim() === ""}>
          {busy ? "Saving …" : "Save the scenario"}
        </button>
        <div id="scenario-verdict">
          <Said verdict={refused ?? verdict} />
        </div>
      </aside>
    </form>
  );
}

/** What the service says of a document; one check at a time, and none of a text that has changed meanwhile. */
function useChecked(text: string): Verdict {
  const [verdict, setVerdict] = useState<Verdict>({ state: "silent" });
  useEffect(() => {
    if (text.trim() === "") return setVerdict({ state: "silent" });
    let left = false;
    setVerdict((before) => (before.state === "wrong" ? before : { state: "asking" }));
    const ask = async () => {
      if (left) return;
      try {
        const check = (await (await posted("v1/scenarios/check", text, YAML)).json()) as Body<"ScenarioCheck">;
        if (!left) setVerdict({ state: "good", check });
      } catch (error) {
        if (!left) setVerdict(wrongOf(error as Error));
      }
    };
    const timer = setTimeout(() => checking(ask), PAUSE_MS);
    return () => {
      left = true;
      clearTimeout(timer);
    };
  }, [text]);
  return verdict;
}

function posted(path: string, body: BodyInit, type: string): Promise<Response> {
  return call(path, { method: "POST", headers: { "Content-Type": type }, body });
}

function wrongOf(error: Error): Verdict {
  if (error instanceof TypeError) return { state: "wrong", wrong: [], why: "The service does not answer." };
  return { state: "wrong", wrong: error instanceof Problem ? error.errors : [], why: error.message };
}

async function isZip(file: File): Promise<boolean> {
  const start = new Uint8Array(await file.slice(0, 2).arrayBuffer());
  return start[0] === 0x50 && start[1] === 0x4b;
}
