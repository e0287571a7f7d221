/** A grid of cards that keeps only the rows in view in the document. */

import { useEffect, useLayoutEffect, useRef, useState } from "preact/hooks";
import type { Signal } from "../../signal";
import { useSize } from "./canvas";
import { Card } from "./card";
import { columnsOf, moved, rowsInView, type Grid } from "./rows";
import type { Found } from "./found";
import type { FailureTable } from "./wire";

const LEAST_PX = 262;
const LEAST_HEIGHT_PX = 372;
const GAP_PX = 14;
const tallest = new Map<number, number>(); // width of a card -> height of the tallest one so far, which all get
const left = new Map<string, number>(); // place -> how far it was scrolled, for the way back from a replay

interface Props {
  campaign: string;
  table: FailureTable;
  found: readonly Found[];
  /** In the order of the cards. */
  shown: readonly number[];
  hovered: Signal<number | null>;
  triage: (failure: number) => void;
  /** Address of the variants of a kind, by its name; null where a card does not stand for a kind. */
  variants: ((kind: string) => string) | null;
  /** The address, with all filters: what is scrolled to is remembered by it. */
  place: string;
}

export function Cards({ campaign, table, found, shown, hovered, triage, variants, place }: Props) {
  const list = useRef<HTMLUListElement>(null);
  const { width } = useSize(list);
  const [top, viewHeight] = useView(list);
  const [focused, setFocused] = useState<string | null>(null); // its card stays in the document when it scrolls away
  const wanted = useRef<number | null>(null);
  const columns = columnsOf({ width, least: LEAST_PX, gap: GAP_PX });
  const cardWidth = (width - GAP_PX * (columns - 1)) / columns;
  const height = tallest.get(cardWidth) ?? LEAST_HEIGHT_PX;
  const pitch = height + GAP_PX;
  const grid: Grid = { size: shown.length, columns, height, gap: GAP_PX };
  const rows = rowsInView(grid, top, viewHeight);
  useComingBack(width > 0, place);
  useEffect(() => {
    if (wanted.current === null) return;
    const link = list.current!.querySelector<HTMLElement>(`[data-at="${wanted.current}"] [data-go]`);
    if (link) wanted.current = null;
    link?.focus({ preventScroll: true });
  });
  const [, again] = useState(0);
  useLayoutEffect(() => {
    const needed = Math.max(...[...list.current!.children].map((card) => Math.ceil(card.getBoundingClientRect().height)));
    if (needed <= height) return;
    tallest.set(cardWidth, needed);
    if (top > 0) scrollBy(0, Math.floor(top / pitch) * (needed - height)); // the rows above have grown too
    again((n) => n + 1);
  });
  const onKeyDown = (event: KeyboardEvent) => {
    const from = Number((event.target as HTMLElement).closest("li")?.dataset.at);
    const to = moved(event.key, from, columns, shown.length);
    if (to === null || Number.isNaN(from) || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    wanted.current = to;
    bringIntoView(list.current!, Math.floor(to / columns) * pitch, pitch);
    again((n) => n + 1);
  };
  const drawn = Array.from({ length: Math.max(0, rows.to - rows.from) }, (_, n) => rows.from + n);
  const held = focused === null ? -1 : shown.findIndex((i) => table.ids[i] === focused);
  if (held >= 0 && (held < rows.from || held >= rows.to)) drawn.push(held);
  return (
    <ul
      class="cards"
      ref={list}
      role="list"
      aria-label={`${shown.length} failures`}
      style={{ height: `${rows.whole}px` }}
      onKeyDown={onKeyDown}
      onFocusIn={(event) => setFocused(idOf(table, shown, event.target))}
      onFocusOut={() => setFocused(null)}
      onPointerLeave={() => hovered.set(null)}
    >
      {width > 0 &&
        drawn.map((at) => {
          const [row, column] = [Math.floor(at / columns), at % columns];
          const failure = shown[at]!;
          const shift = `translate(${column * (cardWidth + GAP_PX)}px, ${row * pitch}px)`;
          return (
            <li
              key={table.ids[failure]}
              data-at={at}
              aria-setsize={shown.length}
              aria-posinset={at + 1}
              style={{ width: `${cardWidth}px`, minHeight: `${height}px`, transform: shift }}
              onPointerEnter={() => hovered.set(failure)}
              onFocusIn={() => hovered.set(failure)}
            >
              <Card {...{ campaign, table, triage, variants }} at={failure} found={found[failure]!} />
            </li>
          );
        })}
    </ul>
  );
}

function idOf(table: FailureTable, shown: readonly number[], target: EventTarget | null): string | null {
  const at = Number((target as HTMLElement).closest("li")?.dataset.at);
  return table.ids[shown[at] ?? -1] ?? null;
}

/** How far the window's upper edge lies below the list's, and the window's height. */
function useView(list: { current: HTMLElement | null }): [number, number] {
  const [view, setView] = useState<[number, number]>([0, innerHeight]);
  useLayoutEffect(() => {
    const look = () => {
      const top = -list.current!.getBoundingClientRect().top;
      setView((before) => (before[0] === top && before[1] === innerHeight ? before : [top, innerHeight]));
    };
    look();
    addEventListener("scroll", look, { passive: true });
    addEventListener("resize", look);
    return () => {
      removeEventListener("scroll", look);
      removeEventListener("resize", look);
    };
  }, []);
  return view;
}

function bringIntoView(list: HTMLElement, row: number, pitch: number): void {
  const top = list.getBoundingClientRect().top + row;
  const [least, most] = [70, innerHeight - pitch];
  if (top < least) scrollBy(0, top - least);
  else if (top > most) scrollBy(0, Math.min(top - most, top - least));
}

/** Scrolls back to where the list was before a replay was opened. */
function useComingBack(ready: boolean, place: string): void {
  const latest = useRef(place);
  latest.current = place;
  useEffect(() => {
    if (!ready) return;
    const before = left.get(place);
    if (before !== undefined) scrollTo(0, before);
    return () => void left.set(latest.current, scrollY); // runs while the cards are still there
  }, [ready]);
}
