/** What the colours and marks on the stage mean, as far as they are drawn. */

import type { ComponentChildren } from "preact";
import { PART_COLOURS, type Colour } from "./colours";
import { useInk } from "./ink";
import type { Part, Recording } from "./recording";
import type { Layers } from "./scene";
import { LAMP_COLOURS, type Lamp } from "./signals";

interface Props {
  recording: Recording;
  layers: Layers;
  /** Whether the ground has signals. */
  signals: boolean;
}

export function Legend({ recording: { moment, parts }, layers, signals }: Props) {
  const ink = useInk();
  const names: Record<Part, string> = {
    ego: "ego",
    striker: moment === "contact" ? "striker" : "nearest road user",
    adversary: parts.includes("striker") ? "other adversary" : "adversary",
    background: "background",
  };
  const line = (colour: string, dash?: string, width = 1.5) => <path d="M1 7H25" stroke={colour} stroke-width={width} stroke-dasharray={dash} />;
  return (
    <ul class="stage-legend small" aria-label="Legend">
      {(Object.keys(names) as Part[])
        .filter((part) => parts.includes(part))
        .map((part) => (
          <Item key={part} name={names[part]}>
            <Body part={part} colour={ink[PART_COLOURS[part]]} surface={ink["--surface"]} />
          </Item>
        ))}
      <Item name="not seen by the ego">
        <rect x="1" y="2" width="24" height="10" rx="2" fill={ink["--background-car"]} fill-opacity="0.18" stroke={ink["--background-car"]} stroke-dasharray="3 2" />
      </Item>
      <Item name={moment}>
        <path d="M10 4 16 10M16 4 10 10" stroke={ink["--text"]} stroke-width="1.5" />
        <circle cx="13" cy="7" r="6" fill="none" stroke={ink["--text"]} stroke-width="1.2" />
      </Item>
      {signals && (
        <>
          <Signal lamp="green" name="signal: green" />
          <Signal lamp="yellow" name="yellow" />
          <Signal lamp="red" name="red" />
        </>
      )}
      {layers.sight && (
        <>
          <Item name="out of the ego's sight">
            <rect x="1" y="1" width="24" height="12" fill={ink["--shade"]} stroke={ink["--line"]} />
          </Item>
          <Item name="line of sight">{line(ink["--striker"], undefined, 1)}</Item>
          <Item name="blocked beyond the cross">
            {line(ink["--striker"], "2 3", 1)}
            <path d="M3 4 9 10M9 4 3 10" stroke={ink["--striker"]} />
          </Item>
        </>
      )}
      {layers.risk && parts.includes("striker") && (
        <>
          <Item name="motion, and body at a predicted contact">
            <path d="M1 7H14" stroke={ink["--striker"]} stroke-width="1.5" stroke-dasharray="4 2" />
            <rect x="14" y="3" width="11" height="8" fill="none" stroke={ink["--striker"]} stroke-dasharray="2 2" />
          </Item>
          {RSS.map(([colour, name]) => (
            <Item key={colour} name={name}>
              <rect x="1" y="3" width="24" height="8" fill={ink[colour]} fill-opacity="0.15" stroke={ink[colour]} stroke-width="1.4" />
              {colour === "--bad" && <path d="M4 11 12 3M12 11 20 3" stroke={ink[colour]} opacity="0.6" />}
            </Item>
          ))}
        </>
      )}
      {layers.trails && (
        <>
          <Item name="last 3 s, a dot each 0.5 s">
            {line(ink["--ego"], undefined, 4)}
            <path d="M6 7h0M18 7h0" stroke={ink["--surface"]} stroke-width="4" stroke-linecap="round" />
          </Item>
          <Item name="whole path">{line(ink["--ego"], "1 3", 1.2)}</Item>
        </>
      )}
    </ul>
  );
}

/** As `risk.ts` draws the RSS margin along the ego's way. */
const RSS: [Colour, string][] = [
  ["--good", "RSS margin ahead"],
  ["--warn", "margin lacking"],
  ["--bad", "dangerous by RSS"],
];

function Item({ name, children }: { name: string; children: ComponentChildren }) {
  return (
    <li>
      <svg width="26" height="14" aria-hidden="true">
        {children}
      </svg>{" "}
      {name}
    </li>
  );
}

function Body({ part, colour, surface }: { part: Part; colour: string; surface: string }) {
  return (
    <>
      <rect x="1" y="2" width="24" height="10" rx="2" fill={colour} fill-opacity={part === "background" ? 0.55 : 1} stroke={colour} />
      {part === "ego" && <circle cx="11" cy="7" r="2.2" fill={surface} />}
      {part === "adversary" && <circle cx="11" cy="7" r="2.2" fill="none" stroke={surface} />}
      {part === "striker" && <path d="M3 12 13 2M8 12 18 2" stroke={surface} opacity="0.6" />}
    </>
  );
}

/** A bar across the lane; a green one leaves its middle open. */
function Signal({ lamp, name }: { lamp: Lamp; name: string }) {
  return (
    <Item name={name}>
      <path d={lamp === "green" ? "M13 0V4M13 10V14" : "M13 0V14"} stroke={LAMP_COLOURS[lamp]} stroke-width="4" />
    </Item>
  );
}
