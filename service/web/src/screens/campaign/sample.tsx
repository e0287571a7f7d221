/** A piece of a run's line, as the curves draw it. */

import type { Mark } from "./look";

export function Sample({ mark }: { mark: Mark }) {
  return (
    <svg class="sample" width="26" height="10" aria-hidden="true">
      <line x1="1" x2="25" y1="5" y2="5" stroke={`var(${mark.colour})`} stroke-width="2.5" stroke-dasharray={mark.dash.join(" ")} />
    </svg>
  );
}
