/** Takes a map from the user's machine to the service, which checks it. */

import { useRef, useState } from "preact/hooks";
import { call } from "../../api/client";
import type { Body } from "../../api/types";
import { address, go } from "../../router";
import { packagingOf } from "./places";

export function Upload() {
  const file = useRef<HTMLInputElement>(null);
  const [label, setLabel] = useState("");
  const [refused, setRefused] = useState("");
  const [busy, setBusy] = useState(false);
  const send = async (event: Event) => {
    event.preventDefault();
    const chosen = file.current!.files?.[0];
    if (!chosen) return setRefused("Choose a file first.");
    setBusy(true);
    setRefused("");
    try {
      const type = packagingOf(new Uint8Array(await chosen.slice(0, 4).arrayBuffer()));
      const named = new URLSearchParams({ label: label || chosen.name });
      const answer = await call(`v1/networks?${named}`, { method: "POST", headers: { "Content-Type": type }, body: chosen });
      const { id } = (await answer.json()) as Body<"Network">;
      go(address(["maps", id], { known: answer.status === 200 ? "yes" : undefined }));
    } catch (error) {
      setRefused(error instanceof TypeError ? "The service does not answer." : (error as Error).message);
      setBusy(false);
    }
  };
  return (
    <form class="card upload" onSubmit={send}>
      <h2>Add a map</h2>
      <p class="small faint">
        A SUMO net, an OpenStreetMap extract or OpenDRIVE, also gzipped. It is checked, converted if need be, and kept without what campaigns
        do not need.
      </p>
      <div class="row">
        <label class="upload-file">
          Map
          <input ref={file} type="file" aria-describedby={refused ? "upload-refused" : undefined} />
        </label>
        <label class="upload-label">
          Label
          <input value={label} maxLength={200} placeholder="the file's name" onInput={(event) => setLabel(event.currentTarget.value)} />
        </label>
        <button class="primary" disabled={busy}>
          {busy ? "Checking …" : "Upload"}
        </button>
      </div>
      {refused && (
        <p class="bad breaking" role="alert" id="upload-refused">
          {refused}
        </p>
      )}
    </form>
  );
}
