/** What the colours and marks on the stage mean. */

import { PART_COLOURS, type Colour } from "./colours";
import { useInk } from "./ink";
import type { Part, Recording } from "./recording";

const PARTS: [Part, string][] = [
  ["ego", "ego"],
  ["striker", ""],
  ["adversary", "other adversary"],
  ["background", "background"],
];

export function Legend({ moment }: { moment: Recording["moment"] }) {
  const ink = useInk();
  const box = (colour: Colour, part: Part | "hidden") => (
    <svg width="26" height="14" aria-hidden="true">
      <rect x="1" y="2" width="24" height="10" rx="2" fill={ink[colour]} fill-opacity={part === "hidden" ? 0.18 : part === "background" ? 0.55 : 1} stroke={ink[colour]} stroke-dasharray={part === "hidden" ? "3 2" : undefined} />
      {part === "ego" && <circle cx="11" cy="7" r="2.2" fill={ink["--surface"]} />}
      {part === "adversary" && <circle cx="11" cy="7" r="2.2" fill="none" stroke={ink["--surface"]} />}
      {part === "striker" && <path d="M3 12 13 2M8 12 18 2" stroke={ink["--surface"]} opacity="0.6" />}
    </svg>
  );
  return (
    <ul class="stage-legend small" aria-label="Legend">
      {PARTS.map(([part, name]) => (
        <li>
          {box(PART_COLOURS[part], part)} {name || (moment === "contact" ? "striker" : "nearest road user")}
        </li>
      ))}
      <li>{box("--background-car", "hidden")} not seen by the ego</li>
      <li>
        <svg width="14" height="14" aria-hidden="true">
          <path d="M4 4 10 10M10 4 4 10" stroke={ink["--text"]} stroke-width="1.5" />
          <circle cx="7" cy="7" r="6" fill="none" stroke={ink["--text"]} stroke-width="1.2" />
        </svg>{" "}
        {moment}
      </li>
      <li>
        <svg width="22" height="12" aria-hidden="true">
          <rect width="22" height="12" fill={ink["--shade"]} stroke={ink["--line"]} />
        </svg>{" "}
        out of the ego's sight
      </li>
    </ul>
  );
}
