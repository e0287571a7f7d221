/** The colours as the theme has them now. */

import { useMemo } from "preact/hooks";
import { useColours } from "../ui/theme";
import { NAMES, type Ink } from "./colours";

/** The same object until a colour changes, so that nothing is made anew for it. */
export function useInk(): Ink {
  const colours = useColours(NAMES);
  return useMemo(() => colours, [Object.values(colours).join()]);
}
