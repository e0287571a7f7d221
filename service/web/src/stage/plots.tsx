/** Curves over the time of the clock; a common line stands where it is, and a click or a drag moves it. */

import { useEffect, useRef } from "preact/hooks";
import uPlot from "uplot";
import type { Clock } from "./clock";
import type { Colour, Ink } from "./colours";
import { useInk } from "./ink";
import { instantAt } from "./interpolate";
import type { Curve, Panel } from "./panels";
import type { Mark } from "./transport";

const HEIGHT = 150;
const FONT = "11px system-ui, sans-serif";
const MARK_COLOURS: Record<Mark["kind"], Colour> = { release: "--faint", conflict: "--warn", moment: "--text" };
const MARK_DASHES: Record<Mark["kind"], number[]> = { release: [2, 3], conflict: [6, 3], moment: [] };

interface Props {
  panels: Panel[];
  clock: Clock;
  marks: Mark[];
  hidden: [number, number][];
}

export function Plots({ panels, ...rest }: Props) {
  return (
    <div class="time-plots">
      {panels.map((panel) => (
        <Plot key={panel.title} panel={panel} {...rest} />
      ))}
    </div>
  );
}

function Plot({ panel, clock, marks, hidden }: Omit<Props, "panels"> & { panel: Panel }) {
  const area = useRef<HTMLDivElement>(null);
  const values = useRef<HTMLElement[]>([]);
  const ink = useInk();

  useEffect(() => {
    const element = area.current!;
    const options = { ...optionsOf(panel, clock, marks, hidden, ink), width: element.clientWidth || 300, height: HEIGHT };
    const plot = new uPlot(options, dataOf(panel.curves), element);
    const line = document.createElement("div");
    line.className = "time-now";
    plot.over.append(line);
    let shown = -1;
    const moved = () => {
      const time = clock.time.get();
      line.style.transform = `translateX(${plot.valToPos(time, "x").toFixed(1)}px)`;
      const step = instantAt(clock.times, time).index;
      if (step === shown) return;
      shown = step; // numbers change with the frames only
      panel.curves.forEach((curve, k) => (values.current[k]!.textContent = valueAt(curve, time)));
    };
    moved();
    const resized = new ResizeObserver(() => {
      if (element.clientWidth > 0) plot.setSize({ width: element.clientWidth, height: HEIGHT });
      moved();
    });
    resized.observe(element);
    const leave = [clock.time.on(moved), seeks(plot, clock)];
    return () => {
      resized.disconnect();
      leave.forEach((off) => off());
      plot.destroy();
    };
  }, [panel, clock, ink]);

  return (
    <figure class="time-plot">
      <figcaption>
        <b>{panel.title}</b> <span class="faint">{panel.unit}</span>
        <span class="time-legend">
          {panel.curves.map((curve, k) => (
            <span class="time-key">
              <Swatch curve={curve} ink={ink} />
              {curve.name} <span class="time-value" ref={(element) => void (element && (values.current[k] = element))} />
            </span>
          ))}
        </span>
      </figcaption>
      <div ref={area} class="time-area" role="img" aria-label={`${panel.title} over time: ${panel.curves.map(({ name }) => name).join(", ")}`} />
    </figure>
  );
}

function Swatch({ curve, ink }: { curve: Curve; ink: Ink }) {
  return (
    <svg width="22" height="8" aria-hidden="true">
      <line x1="0" y1="4" x2="22" y2="4" stroke={ink[curve.colour]} stroke-width={curve.width ?? 1.5} stroke-dasharray={curve.dash?.join(" ")} />
    </svg>
  );
}

function valueAt({ time_s, values }: Curve, time: number): string {
  const value = values[instantAt(time_s, time).index];
  return value === null || value === undefined ? "–" : value.toFixed(Math.abs(value) < 10 ? 2 : 1).replace("-", "−");
}

/** All curves on one axis of time, those of a twin too. */
function dataOf(curves: Curve[]): uPlot.AlignedData {
  const tables = curves.map(({ time_s, values }) => [Array.from(time_s, rounded), values] as uPlot.AlignedData);
  if (tables.length === 0) return [[]];
  const first = tables[0]!;
  if (curves.every(({ time_s }) => time_s === curves[0]!.time_s)) return [first[0], ...tables.map((table) => table[1]!)];
  return uPlot.join(tables);
}

/** So that the same frame of two recordings has the same time. */
function rounded(time: number): number {
  return Math.round(time * 1e4) / 1e4;
}

function optionsOf(panel: Panel, clock: Clock, marks: Mark[], hidden: [number, number][], ink: Ink): Omit<uPlot.Options, "width" | "height"> {
  const axis = { stroke: ink["--faint"], font: FONT, grid: { stroke: ink["--grid"], width: 1 }, ticks: { stroke: ink["--grid"], size: 4 } };
  return {
    legend: { show: false },
    cursor: { show: false },
    padding: [6, 8, 0, 0],
    scales: {
      x: { time: false, range: () => [clock.start, clock.end] },
      y: panel.range ? { range: () => panel.range! } : {},
    },
    axes: [
      { ...axis, size: 24, gap: 3, space: 60, values: (_, splits) => splits.map(minus) },
      { ...axis, size: 38, gap: 3, space: 28, values: (_, splits) => splits.map(minus) },
    ],
    series: [
      {},
      ...panel.curves.map(({ name, colour, dash, width }) => ({ label: name, stroke: ink[colour], dash, width: width ?? 1.5, points: { show: false } })),
    ],
    hooks: {
      drawClear: [(plot) => drawHidden(plot, hidden, ink)],
      drawSeries: panel.zero ? [(plot, k) => k === 1 && drawZero(plot, ink)] : [],
      draw: [(plot) => marks.forEach((mark) => drawMark(plot, mark, ink))],
    },
  };
}

function minus(value: number | null): string {
  return value === null ? "" : String(value).replace("-", "−");
}

function drawHidden({ ctx, bbox, valToPos }: uPlot, hidden: [number, number][], ink: Ink): void {
  ctx.save();
  ctx.fillStyle = ink["--shade"];
  for (const [from, to] of hidden) {
    const left = valToPos(from, "x", true);
    ctx.fillRect(left, bbox.top, valToPos(to, "x", true) - left, bbox.height);
  }
  ctx.restore();
}

function drawZero(plot: uPlot, ink: Ink): void {
  const y = plot.valToPos(0, "y", true);
  const { left, top, width, height } = plot.bbox;
  if (y >= top && y <= top + height) stroke(plot, ink["--faint"], [], left, y, left + width, y);
}

function drawMark(plot: uPlot, { time_s, kind }: Mark, ink: Ink): void {
  const x = plot.valToPos(time_s, "x", true);
  stroke(plot, ink[MARK_COLOURS[kind]], MARK_DASHES[kind], x, plot.bbox.top, x, plot.bbox.top + plot.bbox.height);
}

function stroke({ ctx }: uPlot, colour: string, dash: number[], ...[fromX, fromY, toX, toY]: [number, number, number, number]): void {
  ctx.save();
  ctx.strokeStyle = colour;
  ctx.lineWidth = devicePixelRatio;
  ctx.setLineDash(dash.map((length) => length * devicePixelRatio));
  ctx.beginPath();
  ctx.moveTo(fromX, fromY);
  ctx.lineTo(toX, toY);
  ctx.stroke();
  ctx.restore();
}

function seeks(plot: uPlot, clock: Clock): () => void {
  const { over } = plot;
  const seek = (event: PointerEvent) => {
    if (event.buttons !== 1) return;
    if (event.type === "pointerdown") over.setPointerCapture(event.pointerId);
    clock.pause();
    clock.seek(plot.posToVal(event.clientX - over.getBoundingClientRect().left, "x"));
  };
  over.addEventListener("pointerdown", seek);
  over.addEventListener("pointermove", seek);
  return () => {
    over.removeEventListener("pointerdown", seek);
    over.removeEventListener("pointermove", seek);
  };
}
