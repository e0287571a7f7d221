/** What can be taken along: a picture, the data, a file that plays again, and the commands that do it. */

import type { RefObject } from "preact";
import { useState } from "preact/hooks";
import { absolute, download, hasKey, save } from "../../api/client";
import { Exports } from "./exports";

interface Props {
  campaign: string;
  run: string;
  failure: string;
  path: string;
  stage: RefObject<HTMLElement>;
}

export function Take({ campaign, run, failure, path, stage }: Props) {
  const [trouble, setTrouble] = useState("");
  const attempt = (what: () => Promise<unknown>) => async () => {
    setTrouble("");
    await what().catch((error: Error) => setTrouble(error.message));
  };
  return (
    <section class="card take" aria-label="Take along">
      <div class="row">
        <button onClick={attempt(() => picture(stage.current!, failure))}>Picture (PNG)</button>
        <button onClick={attempt(() => download(path, `${failure}.json`))}>Data (JSON)</button>
        <button onClick={attempt(() => download(`${path}/bundle.npz`, `${failure}.npz`))}>Bundle (NPZ)</button>
      </div>
      <Exports failure={failure} path={path} attempt={attempt} />
      {trouble && (
        <p role="alert" class="bad">
          {trouble}
        </p>
      )}
      <Command name="Play it again, anywhere" text={replayCommand(path, failure)} />
      <Command name="Draw it, where the service keeps its data" text={`risk-sac show ${quoted(`campaigns/${campaign}/${run}`)} ${quoted(failure)} --out ${quoted(`${failure}.png`)}`} />
    </section>
  );
}

function Command({ name, text }: { name: string; text: string }) {
  const [copied, setCopied] = useState<boolean | null>(null);
  const copy = async () => {
    const done = await navigator.clipboard?.writeText(text).then(() => true, () => false);
    setCopied(done ?? false);
  };
  return (
    <div class="command">
      <p class="faint small">{name}</p>
      <div class="command-line">
        <pre tabIndex={0} role="region" aria-label={name}>{text}</pre>
        <button onClick={copy} aria-label={`Copy the command: ${name}`}>
          {copied === null ? "Copy" : copied ? "Copied" : "Select it"}
        </button>
      </div>
      <span role="status" class="hidden-label">
        {copied === null ? "" : copied ? "Copied" : "The browser does not let the page copy"}
      </span>
    </div>
  );
}

export function replayCommand(path: string, failure: string): string {
  const file = quoted(`${failure}.npz`);
  const key = hasKey() ? ' -H "Authorization: Bearer $RISK_SAC_API_KEY"' : "";
  return `curl -sSf${key} ${quoted(absolute(`${path}/bundle.npz`))} -o ${file} && risk-sac replay ${file}`;
}

/** One word of a shell, whatever is in it. */
export function quoted(text: string): string {
  return /^[\w@%+=:,./-]+$/.test(text) ? text : `'${text.replaceAll("'", "'\\''")}'`;
}

async function picture(stage: HTMLElement, failure: string): Promise<void> {
  const canvas = stage.querySelector("canvas")!;
  const content = await new Promise<Blob | null>((done) => canvas.toBlob(done));
  if (content === null) throw new Error("the browser made no picture of the stage");
  save(content, `${failure}_${canvas.dataset.time}s.png`);
}
