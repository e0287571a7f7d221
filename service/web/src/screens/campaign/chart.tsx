/** One plot of uPlot over episodes, a line for each run: hover shows values, drag zooms, double click shows all again. */

import { useEffect, useMemo, useRef, useState } from "preact/hooks";
import uPlot from "uplot";
import { METHOD_COLOURS } from "../../ui/palette";
import { useColours } from "../../ui/theme";
import { COLOURS, type Mark } from "./look";
import { Sample } from "./sample";

export interface Line {
  run: string;
  name: string;
  mark: Mark;
  x: number[];
  y: (number | null)[];
  /** Episodes before the policy's first, which are shaded. */
  warmUp: number;
}

interface Plot {
  title: string;
  meaning: string;
  lines: Line[];
  /** How a value is written. */
  written: (value: number) => string;
  /** How high the plot is at least, so that noise about 0 does not look like mountains. */
  atLeast: number;
  /** The run under the pointer; the others fade. */
  pointed?: string | null;
}

interface Pointer {
  at: number;
  left: number;
}

const HEIGHT = 210;
const SHOWN = 7; // values beside the pointer
const FAR = 0.22;
const SHADE = 0.16;
const PAPER = ["--faint", "--grid", "--surface", ...METHOD_COLOURS, ...COLOURS] as const;

export function Chart({ title, meaning, lines, written, atLeast, pointed }: Plot) {
  const room = useRef<HTMLDivElement>(null);
  const plot = useRef<uPlot | null>(null);
  const [pointer, setPointer] = useState<Pointer | null>(null);
  const [zoomed, setZoomed] = useState(false);
  const [over, setOver] = useState(false);
  const warmUps = useRef<number[]>([]);
  warmUps.current = lines.map((line) => line.warmUp).filter(Boolean);
  const colours = useColours(PAPER);
  const data = useMemo(() => aligned(lines), [lines]);
  const drawn = lines.map((line) => line.run).join(" ");

  useEffect(() => {
    const settings = options(room.current!, lines, colours, atLeast, written, setPointer, setZoomed);
    settings.hooks!.drawClear = [(drawn) => shade(drawn, warmUps.current, colours["--faint"])];
    const made = new uPlot(settings, data, room.current!);
    plot.current = made;
    const resized = new ResizeObserver(() => made.setSize({ width: room.current!.clientWidth, height: HEIGHT }));
    resized.observe(room.current!);
    return () => {
      resized.disconnect();
      made.destroy();
      setZoomed(false);
    };
  }, [drawn, colours]);

  useEffect(() => {
    plot.current?.setData(data, !zoomed); // a zoom stays while the search goes on
    if (zoomed) plot.current?.redraw();
  }, [data]);

  useEffect(() => {
    lines.forEach(({ run }, at) => {
      const series = plot.current?.series[at + 1];
      if (series) series.alpha = !pointed || pointed === run ? 1 : FAR;
    });
    plot.current?.redraw(false);
  }, [pointed, drawn, colours]);

  const show = (event: KeyboardEvent) => {
    if (plot.current && byKey(plot.current, event.key)) event.preventDefault();
  };
  const episode = pointer === null ? undefined : data[0][pointer.at];
  return (
    <section class="card curve" aria-label={title}>
      <header>
        <h3 title={meaning}>{title}</h3>
        <span class="faint small">{meaning}</span>
        {zoomed && (
          <button class="quiet" onClick={() => plot.current && all(plot.current)}>
            Show all
          </button>
        )}
      </header>
      <div
        class="curve-plot"
        ref={room}
        tabIndex={0}
        role="group"
        aria-label={`${title} over episodes. Arrow keys move the pointer, plus and minus zoom, 0 shows all.`}
        onKeyDown={show}
        onPointerEnter={() => setOver(true)}
        onPointerLeave={() => setOver(false)}
        onFocus={() => setOver(true)}
        onBlur={() => setOver(false)}
      >
        {over && pointer && episode !== undefined && (
          <Values episode={episode} left={pointer.left} width={room.current!.clientWidth} lines={lines} data={data} at={pointer.at} written={written} />
        )}
      </div>
    </section>
  );
}

interface Shown {
  episode: number;
  left: number;
  width: number;
  lines: Line[];
  data: uPlot.AlignedData;
  at: number;
  written: (value: number) => string;
}

function Values({ episode, left, width, lines, data, at, written }: Shown) {
  const values = lines
    .map((line, index) => ({ ...line, value: newest(data[index + 1]!, at, line.x.at(-1) ?? 0, episode) }))
    .filter((line): line is Line & { value: number } => line.value !== null)
    .sort((one, other) => other.value - one.value);
  const side = left > width / 2 ? { right: `${width - left + 12}px` } : { left: `${left + 12}px` };
  return (
    <div class="curve-values" style={side} role="status">
      <b>After {episode.toLocaleString("en")} episodes</b>
      {values.slice(0, SHOWN).map((line) => (
        <span key={line.run}>
          <Sample mark={line.mark} /> {line.name} <b>{written(line.value)}</b>
        </span>
      ))}
      {values.length > SHOWN && <span>and {values.length - SHOWN} more</span>}
    </div>
  );
}

/** A run's value at a point of the common axis: its own there or just before; none behind its newest episode. */
function newest(column: ArrayLike<number | null | undefined>, at: number, last: number, episode: number): number | null {
  if (episode > last) return null;
  for (let before = at; before >= 0; before--) {
    if (column[before] !== null && column[before] !== undefined) return column[before]!;
  }
  return null;
}

/** All lines over one axis, as uPlot wants them. */
export function aligned(lines: Line[]): uPlot.AlignedData {
  if (!lines.length) return [[]];
  return uPlot.join(lines.map(({ x, y }) => [x, y]));
}

function options(
  room: HTMLElement,
  lines: Line[],
  colours: Record<(typeof PAPER)[number], string>,
  atLeast: number,
  written: (value: number) => string,
  setPointer: (pointer: Pointer | null) => void,
  setZoomed: (zoomed: boolean) => void,
): uPlot.Options {
  const axis: uPlot.Axis = {
    stroke: colours["--faint"],
    grid: { stroke: colours["--grid"], width: 1 },
    ticks: { show: false },
    font: "12px system-ui, sans-serif",
  };
  return {
    width: room.clientWidth,
    height: HEIGHT,
    legend: { show: false },
    padding: [10, 12, 0, 0],
    cursor: {
      sync: { key: "episodes" },
      points: { size: 7 },
      drag: { x: true, y: false },
    },
    scales: {
      x: { time: false, range: (_, low, high) => (low === high ? [0, high + 1] : [low <= 2 ? 0 : low, high]) },
      y: { range: (_, __, high) => [0, 1.06 * Math.max(atLeast, high ?? 0)] },
    },
    axes: [
      { ...axis, size: 24, gap: 4, values: (_, ticks) => ticks.map((tick) => (Number.isInteger(tick) ? tick.toLocaleString("en") : "")) },
      { ...axis, size: 52, values: (_, ticks) => ticks.map(written) },
    ],
    series: [
      {},
      ...lines.map(({ name, mark }) => ({
        label: name,
        stroke: colours[mark.colour],
        width: 2,
        dash: mark.dash,
        spanGaps: true,
        points: { show: false },
      })),
    ],
    hooks: {
      setCursor: [
        (made) => {
          const { idx, left } = made.cursor;
          setPointer(idx === null || idx === undefined || left === undefined || left < 0 ? null : { at: idx, left: left + made.bbox.left / devicePixelRatio });
        },
      ],
      setScale: [
        (made, key) => {
          if (key === "x") setZoomed(isZoomed(made));
        },
      ],
    },
  };
}

/** Ground behind the warm-up of each run; the more runs share it, the darker. */
function shade(made: uPlot, warmUps: number[], colour: string): void {
  const { ctx, bbox } = made;
  ctx.save();
  ctx.fillStyle = colour;
  ctx.globalAlpha = SHADE / Math.max(1, warmUps.length);
  for (const end of warmUps) {
    const x = Math.min(bbox.left + bbox.width, made.valToPos(end, "x", true));
    if (x > bbox.left) ctx.fillRect(bbox.left, bbox.top, x - bbox.left, bbox.height);
  }
  ctx.restore();
}

function isZoomed(made: uPlot): boolean {
  const [x] = made.data;
  const { min, max } = made.scales.x!;
  return x.length > 1 && min != null && max != null && (min > x[0]! || max < x[x.length - 1]!);
}

function all(made: uPlot): void {
  const [x] = made.data;
  if (x.length) made.setScale("x", { min: x[0]!, max: x[x.length - 1]! });
}

/** What a key does; false if nothing. */
function byKey(made: uPlot, key: string): boolean {
  const [x] = made.data;
  if (!x.length) return false;
  const { min, max } = made.scales.x! as { min: number; max: number };
  const at = made.cursor.idx ?? x.length - 1;
  if (key === "ArrowLeft" || key === "ArrowRight") {
    const to = Math.min(x.length - 1, Math.max(0, at + (key === "ArrowLeft" ? -1 : 1)));
    made.setCursor({ left: made.valToPos(x[to]!, "x"), top: made.over.clientHeight / 2 });
  } else if (key === "+" || key === "-") {
    const middle = x[at]!;
    const half = ((max - min) / 2) * (key === "+" ? 0.6 : 1 / 0.6);
    made.setScale("x", { min: Math.max(x[0]!, middle - half), max: Math.min(x[x.length - 1]!, middle + half) });
  } else if (key === "0") all(made);
  else return false;
  return true;
}
