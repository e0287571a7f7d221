/** One kind, variant or episode: what is needed to decide whether to open it. */

import { address } from "../../router";
import { drivenWords } from "../../ui/driven";
import { number, words } from "../../ui/text";
import { reactionOf } from "./features";
import { GradeTag, Mark } from "./grade";
import { refusal } from "../../ui/verdicts";
import { NO_CONTACT } from "../../ui/violations";
import { variantOf } from "./filters";
import type { Found } from "./found";
import { halves, TRIAGE } from "./naming";
import { useThumbnail } from "../../ui/thumbnails";
import type { FailureTable } from "./wire";

interface Props {
  campaign: string;
  table: FailureTable;
  /** Which one, by its place in the columns. */
  at: number;
  found: Found;
  triage: (failure: number) => void;
  /** Address of the variants of a kind, by its name; null where the card does not stand for a kind. */
  variants: ((kind: string) => string) | null;
}

export function Card({ campaign, table, at, found, triage, variants }: Props) {
  const id = table.ids[at]!;
  const kind = table.kinds[table.kind[at]!]!.name;
  const [striker, ego] = halves(kind);
  const state = table.triage[at]!;
  const other = table.striker[at] ?? null;
  return (
    <article class="failure">
      <Thumbnail campaign={campaign} id={id} />
      <div class="judged">
        {table.plausibility[at] && (
          <span class="tag" title={table.unlikely[at]}>
            {table.plausibility[at]}
          </span>
        )}
        {table.severity[at] && <span class="tag">{table.severity[at]}</span>}
        {table.fault[at] && <span class="tag">fault: {table.fault[at]}</span>}
        {table.valid[at] ? <GradeTag grade={table.grade[at] ?? "none"} /> : <Refusal rules={table.refused_by[at]!} />}
        <Repeats repeats={table.repeats[at]!} />
        {table.requirement[at] !== NO_CONTACT && <span class="tag">{words(table.requirement[at]!)}</span>}
      </div>
      <div class="what">
        <a href={address(["campaigns", campaign, "failures", id])} title={kind} data-go>
          {striker}
        </a>
        <p class="faint small ego">
          {ego}
          {variants && found.variants > 1 ? (
            <>
              {" · "}
              <a href={variants(kind)}>{found.variants} variants</a>
            </>
          ) : (
            variantOf(table, at) && ` · ${variantOf(table, at)}`
          )}
        </p>
      </div>
      <dl class="measures">
        {table.requirement[at] === NO_CONTACT ? (
          <>
            <Measure name="closing speed" value={number(table.relative_speed_mps[at], 1)} unit="m/s" />
            <Measure name="from conflict" value={number(reactionOf(table, at), 1)} unit="s" />
          </>
        ) : (
          <>
            <Measure name="ego's speed" value={number(table.ego_speed_mps[at], 1)} unit="m/s" />
            <Measure name="after release" value={number(table.time_s[at], 1)} unit="s" />
          </>
        )}
        {table.valid[at] && <Measure name="found in" value={`${found.episodes}`} unit={found.episodes === 1 ? "episode" : "episodes"} />}
      </dl>
      <div class="foot small">
        <div class="found-by faint">
          <p title={`${found.episodes} episodes of ${found.runs} runs`}>
            Found by <b>{found.methods.join(", ")}</b>
            {found.drivers.length > 0 && ` · driven ${found.drivers.map(drivenWords).join(", ")}`}
          </p>
          <p title={other === null ? `no other road user near, ${id}` : `${words(other)} (${table.striker_kind[at]}), ${id}`}>
            {table.families[at]} · {other === null ? "ego alone" : words(other)}
          </p>
        </div>
        <button class={`tag triage-${state}`} onClick={() => triage(at)} aria-label={`Triage: ${TRIAGE[state]}. Change`}>
          {TRIAGE[state]} ▾
        </button>
      </div>
    </article>
  );
}

function Thumbnail({ campaign, id }: { campaign: string; id: string }) {
  const url = useThumbnail(`v1/campaigns/${encodeURIComponent(campaign)}/failures/${encodeURIComponent(id)}/thumbnail.svg`);
  if (url) return <img class="thumbnail" src={url} alt="" />;
  return <div class="thumbnail">{url === "" && <span class="faint small">no picture</span>}</div>;
}

function Refusal({ rules }: { rules: readonly string[] }) {
  const [first, ...more] = rules.map(refusal);
  return (
    <span class="grade" title={rules.map(refusal).join("; ")}>
      <Mark grade="none" /> {first ?? "refused"}
      {more.length > 0 && ` +${more.length}`}
    </span>
  );
}

function Repeats({ repeats }: { repeats: FailureTable["repeats"][number] }) {
  if (repeats === null) return null;
  const [text, title] =
    repeats === "verified" ? ["✓ verified", "Each replay was the same"] : ["≈ flaky", "A replay went differently"];
  return (
    <span class={`grade ${repeats}`} title={title}>
      {text}
    </span>
  );
}

function Measure({ name, value, unit }: { name: string; value: string; unit: string }) {
  return (
    <div>
      <dt>{name}</dt>
      <dd>
        {value} {unit && <span class="unit">{unit}</span>}
      </dd>
    </div>
  );
}
