/** Server-sent events, read by `fetch`: an EventSource cannot send the key. */

import { call, connected } from "./client";

export interface ServerEvent {
  id: string;
  event: string;
  data: string;
}

const AGAIN_MS = 2000;

/** Reads a stream to its end, and takes it up again behind the last event wherever the connection breaks. */
export async function follow(
  path: string,
  tell: (events: ServerEvent[]) => void,
  signal: AbortSignal,
  last = "",
): Promise<void> {
  while (!signal.aborted) {
    try {
      const response = await call(path, { signal, headers: last ? { "Last-Event-ID": last } : {} });
      if (response.status === 204 || response.body === null) return;
      const reader = response.body.pipeThrough(new TextDecoderStream()).getReader();
      let rest = "";
      for (;;) {
        const { done, value } = await reader.read();
        if (done) break;
        const [events, left] = parsed(rest + value);
        rest = left;
        last = events.at(-1)?.id ?? last;
        if (events.length) tell(events);
      }
    } catch (error) {
      if (signal.aborted) return;
      if (!(error instanceof TypeError)) throw error; // a problem: asking again would not help
      connected.set(false);
    }
    await new Promise((over) => setTimeout(over, AGAIN_MS));
  }
}

/** The events that a text holds in whole, and what is left of it. */
export function parsed(text: string): [ServerEvent[], string] {
  const blocks = text.replaceAll("\r\n", "\n").split("\n\n");
  const rest = blocks.pop()!;
  const events = blocks.flatMap((block) => {
    const event: ServerEvent = { id: "", event: "message", data: "" };
    const data: string[] = [];
    for (const line of block.split("\n")) {
      const [, name, value] = /^([^:]*):? ?(.*)$/.exec(line)!;
      if (name === "data") data.push(value!);
      else if (name === "id") event.id = value!;
      else if (name === "event") event.event = value!;
    }
    return data.length ? [{ ...event, data: data.join("\n") }] : [];
  });
  return [events, rest];
}
