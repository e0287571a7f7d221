/** The same campaign for a shell and for a file. */

import { useRef, useState } from "preact/hooks";
import { absolute, hasKey } from "../../api/client";
import { textOf } from "./body";
import type { Values } from "./schema";
import { curl } from "./shell";
import { yaml } from "./yaml";

const FORMS = {
  curl: { title: "curl", hint: "Posts the same campaign from a shell." },
  yaml: { title: "YAML", hint: "As spec.yaml, for risk-sac campaigns submit --spec spec.yaml." },
} as const;
type Name = keyof typeof FORMS;

export function Preview({ body }: { body: Values }) {
  const [name, setName] = useState<Name>("curl");
  const names = (Object.keys(FORMS) as Name[]).filter((each) => each === "curl" || !("network" in body)); // spec files name families
  const text = name === "curl" ? curl(absolute("v1/campaigns"), textOf(body), hasKey()) : yaml(body);
  return (
    <section class="card preview" aria-labelledby="preview-title">
      <div class="row">
        <h2 id="preview-title">The same as</h2>
        {names.map((each) => (
          <button key={each} type="button" aria-pressed={each === name} onClick={() => setName(each)}>
            {FORMS[each].title}
          </button>
        ))}
        <Copy text={text} key={name} />
      </div>
      <p class="help">{FORMS[name].hint}</p>
      <pre class="source" tabIndex={0} role="region" aria-label={`The campaign as ${FORMS[name].title}`}>
        {text}
      </pre>
    </section>
  );
}

function Copy({ text }: { text: string }) {
  const [copied, setCopied] = useState<string>();
  const hidden = useRef<HTMLTextAreaElement>(null);
  const copy = async () => {
    if (navigator.clipboard) await navigator.clipboard.writeText(text);
    else {
      hidden.current!.select(); // a page that came by plain HTTP from another machine has no clipboard
      document.execCommand("copy");
    }
    setCopied(text);
  };
  return (
    <>
      <button type="button" class="copy" onClick={copy}>
        {copied === text ? "Copied" : "Copy"}
      </button>
      {!navigator.clipboard && <textarea ref={hidden} class="hidden-label" value={text} readOnly tabIndex={-1} aria-hidden="true" />}
    </>
  );
}
