/** The title of the browser's tab. */

import { useEffect } from "preact/hooks";

/** Names what is shown, the narrowest first: `Failures · nightly · RISK-SAC`; what is not known yet is left out. */
export function useTitle(...parts: (string | null | undefined)[]): void {
  const title = [...parts.filter(Boolean), "RISK-SAC"].join(" · ");
  useEffect(() => {
    document.title = title;
  }, [title]);
}
