/** Pictures that a key may be needed for: fetched, and shown from memory. */

import { useEffect, useState } from "preact/hooks";
import { call } from "../api/client";

/** A picture as an address that lasts as long as the component does. */
export function usePicture(path: string | undefined): { url?: string; error?: string } {
  const [state, setState] = useState<{ url?: string; error?: string }>({});
  useEffect(() => {
    if (path === undefined) return;
    const left = new AbortController();
    let url: string | undefined;
    call(path, { signal: left.signal })
      .then((response) => response.blob())
      .then((blob) => {
        if (!left.signal.aborted) setState({ url: (url = URL.createObjectURL(blob)) });
      })
      .catch((error: Error) => {
        if (!left.signal.aborted) setState({ error: error.message });
      });
    return () => {
      left.abort();
      if (url) URL.revokeObjectURL(url);
    };
  }, [path]);
  return state;
}
