/** What a screen shows while it has nothing to show. */

import type { ComponentChildren } from "preact";
import type { Asked } from "../api/asked";

export function Loading({ what }: { what: string }) {
  return (
    <p class="state" role="status">
      <span class="spinner" aria-hidden="true" /> Loading {what} …
    </p>
  );
}

export function Empty({ children }: { children: ComponentChildren }) {
  return <div class="state">{children}</div>;
}

export function Failed({ error, again }: { error: Error; again?: () => void }) {
  const lost = error instanceof TypeError;
  return (
    <div class="state state-error" role="alert">
      <p>{lost ? "The service does not answer." : error.message}</p>
      {again && <button onClick={again}>Try again</button>}
    </div>
  );
}

/** Loading, the error or the value; a value that is there stays, also while the service does not answer. */
export function Shown<T>({ asked, what, children }: { asked: Asked<T>; what: string; children: (value: T) => ComponentChildren }) {
  if (asked.value !== undefined) return <>{children(asked.value)}</>;
  if (asked.error) return <Failed error={asked.error} again={asked.again} />;
  return <Loading what={what} />;
}
