/** The formats of other tools: a menu of those that the service has, and a button that makes one. */

import { useState } from "preact/hooks";
import { useAsked } from "../../api/asked";
import { download } from "../../api/client";
import type { Body } from "../../api/types";

type Format = Body<"ExportFormat">;

interface Props {
  failure: string;
  path: string;
  attempt: (what: () => Promise<unknown>) => () => Promise<void>;
}

export function Exports({ failure, path, attempt }: Props) {
  const formats = (useAsked<Body<"ExportFormats">>("v1/formats").value?.items ?? []).filter(({ of }) => of === "failure");
  const [name, setName] = useState<Format["name"]>();
  const [making, setMaking] = useState(false);
  const chosen = formats.find((format) => format.name === name) ?? formats[0];
  if (chosen === undefined) return null;
  const make = attempt(async () => {
    setMaking(true);
    await download(`${path}/export?format=${chosen.name}`, fileName(failure, chosen)).finally(() => setMaking(false));
  });
  return (
    <div class="exports">
      <label>
        For other tools{" "}
        <select value={chosen.name} onChange={(event) => setName(event.currentTarget.value as Format["name"])}>
          {formats.map((format) => (
            <option key={format.name} value={format.name} disabled={format.missing.length > 0}>
              {format.title}
              {format.missing.length > 0 && " (not installed)"}
            </option>
          ))}
        </select>
      </label>
      <button onClick={make} disabled={making || chosen.missing.length > 0}>
        {making ? "Preparing …" : "Download"}
      </button>
      <p class="faint small">{chosen.what}</p>
    </div>
  );
}

/** As the service names it too. */
export function fileName(failure: string, { name, suffix }: Pick<Format, "name" | "suffix">): string {
  return suffix === ".zip" ? `${failure}-${name}.zip` : `${failure}${suffix}`;
}
