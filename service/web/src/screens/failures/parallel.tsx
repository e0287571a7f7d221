/** Parallel coordinates: an axis per feature, a line per failure, and brushes that leave only what they hold. */

import { useMemo, useRef, useState } from "preact/hooks";
import { useSignal, type Signal } from "../../signal";
import { useColours } from "../../ui/theme";
import { brushed, rounded, type Brushes, type Interval } from "./brushes";
import { usePaint, useSize } from "./canvas";
import { titled, type Feature } from "./features";
import { drawAxes, drawLines, strokeLine, type Ink, type Lines } from "./lines";
import { RangesByNumbers } from "./ranges";
import { domain, linear } from "./scale";
import type { FailureTable } from "./wire";

export const PITCH_PX = 30; // from one axis to the next
const INSET_PX = 10;
const CLICK_PX = 4; // a drag shorter than this is a click, which takes the brush away
const COLOURS = ["--surface", "--text", "--faint", "--line", "--accent", "--preventable", "--full_braking", "--unavoidable"] as const;

interface Props {
  table: FailureTable;
  features: readonly Feature[];
  all: readonly number[];
  shown: readonly number[];
  brushes: Brushes;
  hovered: Signal<number | null>;
  /** `done` is false while the pointer still drags. */
  brush: (brushes: Brushes, done: boolean) => void;
}

export function Parallel(props: Props) {
  const { table, features, all, shown, brushes, hovered, brush } = props;
  const box = useRef<HTMLDivElement>(null);
  const [back, front] = [useRef<HTMLCanvasElement>(null), useRef<HTMLCanvasElement>(null)];
  const size = useSize(box);
  const colours = useColours(COLOURS);
  const lines: Lines = useMemo(() => {
    const spans = features.map(({ values }) => domain(Float64Array.from(all, (i) => values[i]!)));
    const scales = spans.map(([low, high]) => linear(low, high, INSET_PX, size.width - INSET_PX));
    return { features, scales, pitch: PITCH_PX, grades: table.grade };
  }, [features, all, size, table]);
  const ink: Ink = { ...inkOf(colours), brush: colours["--accent"] };
  const filtered = shown.length < all.length; // else the lines in front hide all that lie behind
  usePaint(back, size, (context) => filtered && drawLines(context, lines, size, all, () => ink.hidden), [lines, all, filtered, colours]);
  usePaint(
    front,
    size,
    (context) => {
      drawLines(context, lines, size, shown, (grade) => ink.grades[grade ?? "none"]!);
      drawAxes(context, lines, size, brushes, ink);
    },
    [lines, shown, brushes, colours],
  );
  const drag = useDrag(lines, brushes, brush);
  return (
    <section class="card plot" aria-label="Parallel coordinates">
      <div class="row plot-head">
        <h2>Ranges</h2>
        {brushes.size ? (
          <button class="small" onClick={() => brush(new Map(), true)}>
            Clear all
          </button>
        ) : (
          <span class="faint small">Drag along an axis to keep only what lies there.</span>
        )}
      </div>
      <div class="parallel">
        <ul>
          {features.map((feature) => (
            <li key={feature.key} style={{ height: `${PITCH_PX}px` }} data-brushed={brushes.has(feature.key) || undefined}>
              <span title={titled(feature)}>
                {feature.label} <span class="unit">{feature.unit}</span>
              </span>
              {brushes.has(feature.key) && (
                <button class="drop" aria-label={`Clear the range of ${feature.label}`} onClick={() => brush(brushed(brushes, feature.key, null), true)}>
                  ×
                </button>
              )}
            </li>
          ))}
        </ul>
        <div class="lines" ref={box} style={{ height: `${features.length * PITCH_PX}px` }} {...drag}>
          {/* All of them lie behind those that no filter hides: drawn once, however the brushes move. */}
          <canvas ref={back} aria-hidden="true" />
          <canvas ref={front} role="img" aria-label={`${shown.length} of ${all.length} failures as lines over ${features.length} axes`} />
          <PointedLine {...{ lines, hovered, size, ink: colours["--text"] }} />
        </div>
      </div>
      <RangesByNumbers {...{ features, brushes, brush: (next: Brushes) => brush(next, true) }} />
    </section>
  );
}

/** The line of what the pointer is at, here or on a card. */
function PointedLine({ lines, hovered, size, ink }: { lines: Lines; hovered: Signal<number | null>; size: { width: number; height: number }; ink: string }) {
  const at = useSignal(hovered);
  const canvas = useRef<HTMLCanvasElement>(null);
  const paint = (context: CanvasRenderingContext2D) => {
    if (at === null) return;
    context.strokeStyle = ink;
    context.lineWidth = 2;
    context.beginPath();
    strokeLine(context, lines, at);
    context.stroke();
  };
  usePaint(canvas, size, paint, [at, lines, ink]);
  return <canvas ref={canvas} aria-hidden="true" />;
}

/** Brushing by the pointer; what is dragged is shown at once, and kept when the pointer lets go. */
function useDrag({ features, scales }: Lines, brushes: Brushes, brush: Props["brush"]) {
  const [begun, setBegun] = useState<{ axis: number; from: number; before: Brushes } | null>(null);
  const placeOf = (event: PointerEvent) => {
    const place = (event.currentTarget as HTMLElement).getBoundingClientRect();
    return { x: event.clientX - place.left, axis: Math.floor((event.clientY - place.top) / PITCH_PX) };
  };
  const dragged = (event: PointerEvent, done: boolean) => {
    if (!begun) return;
    const { x } = placeOf(event);
    const scale = scales[begun.axis]!;
    const value = (at: number) => Math.min(scale.high, Math.max(scale.low, scale.of(at)));
    const interval: Interval | null =
      Math.abs(x - begun.from) < CLICK_PX ? null : rounded([value(begun.from), value(x)], scale.high - scale.low);
    if (done || interval) brush(brushed(begun.before, features[begun.axis]!.key, interval), done);
    if (done) setBegun(null);
  };
  return {
    onPointerDown: (event: PointerEvent) => {
      const { x, axis } = placeOf(event);
      if (event.button !== 0 || axis < 0 || axis >= features.length) return;
      (event.currentTarget as HTMLElement).setPointerCapture(event.pointerId);
      setBegun({ axis, from: x, before: brushes });
    },
    onPointerMove: (event: PointerEvent) => dragged(event, false),
    onPointerUp: (event: PointerEvent) => dragged(event, true),
    onPointerCancel: () => {
      if (begun) brush(begun.before, true);
      setBegun(null);
    },
  };
}

function inkOf(colours: Record<(typeof COLOURS)[number], string>): Omit<Ink, "brush"> {
  return {
    hidden: { colour: colours["--line"], width: 1 },
    grades: {
      preventable: { colour: colours["--preventable"], width: 1.8 },
      full_braking: { colour: colours["--full_braking"], width: 1.1 },
      unavoidable: { colour: colours["--unavoidable"], width: 0.8 },
      none: { colour: colours["--faint"], width: 0.8 },
    },
    axis: colours["--faint"],
    text: colours["--text"],
    ground: colours["--surface"],
  };
}
