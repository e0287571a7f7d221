/** The report's figures, fetched with the key and shown from memory. */

import { useState } from "preact/hooks";
import { useAsked } from "../../api/asked";
import { download } from "../../api/client";
import type { Body } from "../../api/types";
import { usePicture } from "../../ui/picture";
import { Shown } from "../../ui/states";

type Figure = Body<"Figure">;

const TITLES: Record<string, string> = {
  ecr: "Sliding ECR over the search",
  pcr: "Sliding PCR over the search",
  lambda: "Dual variable λ over the search",
  alpha: "Temperature α over the search",
  preventable_found: "Distinct preventable failures over processor time",
  distinct_found: "Distinct failures over processor time",
  times: "Time from the release to conflict and contact",
};

/** `preventable_found_low` in words. */
export function titleOf(name: string): string {
  const [, kind, family] = /^(.*)_([^_]+)$/.exec(name) ?? [];
  if (kind && TITLES[kind]) return `${TITLES[kind]}: ${family}`;
  return name.replace(/^bars_/, "All families: ").replaceAll("_", " ");
}

export function Figures({ campaign, names, columns }: { campaign: string; names?: (name: string) => boolean; columns?: boolean }) {
  const asked = useAsked<Body<"Figures">>(`v1/campaigns/${campaign}/figures`, (figures) => (figures.complete ? null : 20_000));
  return (
    <Shown asked={asked} what="figures">
      {({ items }) => {
        const chosen = items.filter((figure) => !names || names(figure.name));
        if (!chosen.length) return <p class="faint">No figure yet: no run has got so far.</p>;
        return (
          <div class={`pictures ${columns ? "pictures-two" : ""}`}>
            {chosen.map((figure) => (
              <Picture key={figure.name} figure={figure} />
            ))}
          </div>
        );
      }}
    </Shown>
  );
}

function Picture({ figure }: { figure: Figure }) {
  const title = titleOf(figure.name);
  const [refused, setRefused] = useState("");
  const drawn = figure.files.find((file) => file.format === "svg") ?? figure.files[0];
  const { url, error } = usePicture(drawn?.href);
  const save = (file: Figure["files"][number]) =>
    download(file.href, `${figure.name}.${file.format}`).then(() => setRefused(""), (problem: Error) => setRefused(problem.message));
  return (
    <figure class="picture">
      <div class="paper">{url ? <img src={url} alt={title} /> : <span class="faint">{error ?? "Loading …"}</span>}</div>
      <figcaption>
        {title}
        <span class="joined" role="group" aria-label={`Download ${title}`}>
          {figure.files.map((file) => (
            <button key={file.format} onClick={() => save(file)}>
              {file.format.toUpperCase()}
            </button>
          ))}
        </span>
        {refused && <span role="alert" class="bad small">{refused}</span>}
      </figcaption>
    </figure>
  );
}
