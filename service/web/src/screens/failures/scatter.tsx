/** Any two features of the failures against each other, marked by grade. */

import { useMemo, useRef } from "preact/hooks";
import { useSignal, type Signal } from "../../signal";
import { useColours } from "../../ui/theme";
import { number } from "../../ui/text";
import { usePaint, useSize, type Size } from "./canvas";
import { titled, type Feature } from "./features";
import { stamp } from "./marks";
import { GRADES, GRADE_WORDS, type GradeName } from "../../ui/verdicts";
import { Mark } from "./grade";
import { domain, linear, ticks, tickText, type Scale } from "./scale";
import type { FailureTable } from "./wire";

const COLOURS = ["--surface", "--text", "--faint", "--line", "--grid", "--preventable", "--full_braking", "--unavoidable"] as const;
const MARGIN = { left: 46, right: 12, top: 10, bottom: 38 };
const REACH_PX = 14; // how near the pointer has to come to a mark

interface Props {
  table: FailureTable;
  features: readonly Feature[];
  x: string;
  y: string;
  /** All failures of the tab, which the axes span; those that no filter hides stand out. */
  all: readonly number[];
  shown: readonly number[];
  hovered: Signal<number | null>;
  choose: (axes: { x?: string; y?: string }) => void;
  open: (failure: number) => void;
}

export function Scatter(props: Props) {
  const { table, features, all, shown, hovered, choose, open } = props;
  const x = features.find(({ key }) => key === props.x) ?? features[1]!;
  const y = features.find(({ key }) => key === props.y) ?? features[0]!;
  const box = useRef<HTMLDivElement>(null);
  const back = useRef<HTMLCanvasElement>(null);
  const size = useSize(box);
  const colours = useColours(COLOURS);
  const scales = useMemo(() => scalesOf(x, y, all, size), [x, y, all, size]);
  usePaint(
    back,
    size,
    (context, ratio) => {
      const { "--grid": grid, "--faint": faint, "--surface": surface, "--line": line } = colours;
      const across = linear(scales.x.low, scales.x.high, MARGIN.left, size.width - MARGIN.right);
      drawAxes(context, { ...scales, x: across }, size, { grid, faint }, [titled(x), titled(y)]);
      const hidden = new Set(shown);
      context.fillStyle = line;
      for (const i of all) if (!hidden.has(i)) dot(context, scales, x.values[i]!, y.values[i]!);
      const r = shown.length > 2000 ? 3 : 4.2;
      for (const grade of [...GRADES].reverse()) {
        const picture = stamp(grade, colourOf(colours, grade), surface, r, ratio);
        const half = picture.width / ratio / 2;
        for (const i of shown) {
          if ((table.grade[i] ?? "none") !== grade) continue;
          const [left, top] = [scales.x.at(x.values[i]!) - half, scales.y.at(y.values[i]!) - half];
          if (left === left && top === top) context.drawImage(picture, left, top, 2 * half, 2 * half);
        }
      }
    },
    [scales, shown, colours, table],
  );
  const nearest = (event: PointerEvent | MouseEvent) => {
    const place = box.current!.getBoundingClientRect();
    return nearestOf(shown, x, y, scales, event.clientX - place.left, event.clientY - place.top);
  };
  const without = shown.filter((i) => Number.isNaN(x.values[i]! + y.values[i]!)).length;
  return (
    <section class="card plot" aria-label="Scatter plot">
      <div class="row plot-head plot-axes">
        <AxisChoice label="Vertical axis" chosen={y} features={features} choose={(key) => choose({ y: key })} />
        <span class="faint">over</span>
        <AxisChoice label="Horizontal axis" chosen={x} features={features} choose={(key) => choose({ x: key })} />
      </div>
      <div
        class="scatter"
        ref={box}
        onPointerMove={(event) => hovered.set(nearest(event))}
        onPointerLeave={() => hovered.set(null)}
        onClick={(event) => {
          const failure = nearest(event);
          if (failure !== null) open(failure);
        }}
      >
        <canvas ref={back} role="img" aria-label={`${shown.length} failures: ${titled(y)} over ${titled(x)}, marked by grade`} />
        <Pointed {...{ table, hovered, x, y, scales, size }} />
      </div>
      <p class="legend small">
        {GRADES.filter((grade) => grade !== "none" || all.some((i) => table.grade[i] === null)).map((grade) => (
          <span key={grade} title={GRADE_WORDS[grade].long}>
            <Mark grade={grade} /> {GRADE_WORDS[grade].short}
          </span>
        ))}
        {without > 0 && <span class="faint">{without} without a value</span>}
      </p>
    </section>
  );
}

/** A ring around what the pointer is at, here or on a card, and what it is. */
function Pointed({ table, hovered, x, y, scales, size }: Pick<Props, "table" | "hovered"> & { x: Feature; y: Feature; scales: Scales; size: Size }) {
  const at = useSignal(hovered);
  if (at === null || at >= table.ids.length) return null;
  const [left, top] = [scales.x.at(x.values[at]!), scales.y.at(y.values[at]!)];
  if (Number.isNaN(left + top)) return null;
  const side = left > size.width / 2 ? { right: `${size.width - left + 12}px` } : { left: `${left + 12}px` };
  return (
    <>
      <span class="ring" style={{ left: `${left}px`, top: `${top}px` }} />
      <div class="tip small" style={{ ...side, top: `${Math.min(top, size.height - 90)}px` }}>
        <b>{table.kinds[table.kind[at]!]!.name}</b>
        <br />
        {[x, y].map((feature) => (
          <span key={feature.key}>
            {feature.label} {number(feature.values[at])} {feature.unit}
            <br />
          </span>
        ))}
      </div>
    </>
  );
}

function AxisChoice({ label, chosen, features, choose }: { label: string; chosen: Feature; features: readonly Feature[]; choose: (key: string) => void }) {
  const [scene, outcome] = [true, false].map((wanted) => features.filter(({ key }) => key.startsWith("scene.") === wanted)) as [Feature[], Feature[]];
  const options = (some: Feature[]) => some.map((each) => <option key={each.key} value={each.key}>{titled(each)}</option>);
  return (
    <label>
      <span class="hidden-label">{label}</span>
      <select value={chosen.key} onChange={(event) => choose(event.currentTarget.value)}>
        <optgroup label="How it came out">{options(outcome)}</optgroup>
        {scene.length > 0 && <optgroup label="The scene">{options(scene)}</optgroup>}
      </select>
    </label>
  );
}

interface Scales {
  x: Scale;
  y: Scale;
}

function scalesOf(x: Feature, y: Feature, all: readonly number[], { width, height }: Size): Scales {
  const spanOf = ({ values }: Feature) => domain(Float64Array.from(all, (i) => values[i]!));
  return {
    x: linear(...spanOf(x), MARGIN.left, width - MARGIN.right),
    y: linear(...spanOf(y), height - MARGIN.bottom, MARGIN.top),
  };
}

function drawAxes(context: CanvasRenderingContext2D, { x, y }: Scales, size: Size, ink: { grid: string; faint: string }, titles: [string, string]): void {
  const [foot, right] = [size.height - MARGIN.bottom, size.width - MARGIN.right];
  context.strokeStyle = ink.grid;
  context.fillStyle = ink.faint;
  context.font = "11px system-ui, sans-serif";
  context.lineWidth = 1;
  context.beginPath();
  const [many, few] = [Math.max(2, size.width / 75), Math.max(2, size.height / 45)];
  context.textAlign = "center";
  for (const tick of ticks(x.low, x.high, many)) {
    const at = Math.round(x.at(tick)) + 0.5;
    context.moveTo(at, MARGIN.top);
    context.lineTo(at, foot);
    context.fillText(tickText(tick, x.low, x.high, many), at, foot + 14);
  }
  context.textAlign = "right";
  for (const tick of ticks(y.low, y.high, few)) {
    const at = Math.round(y.at(tick)) + 0.5;
    context.moveTo(MARGIN.left, at);
    context.lineTo(right, at);
    context.fillText(tickText(tick, y.low, y.high, few), MARGIN.left - 6, at + 4);
  }
  context.stroke();
  context.textAlign = "center";
  context.fillText(titles[0], (MARGIN.left + right) / 2, size.height - 6);
  context.save();
  context.translate(11, (MARGIN.top + foot) / 2);
  context.rotate(-Math.PI / 2);
  context.fillText(titles[1], 0, 0);
  context.restore();
}

function dot(context: CanvasRenderingContext2D, { x, y }: Scales, a: number, b: number): void {
  if (a === a && b === b) context.fillRect(x.at(a) - 1.25, y.at(b) - 1.25, 2.5, 2.5);
}

function colourOf(colours: Record<(typeof COLOURS)[number], string>, grade: GradeName): string {
  return grade === "none" ? colours["--faint"] : colours[`--${grade}`];
}

function nearestOf(shown: readonly number[], x: Feature, y: Feature, scales: Scales, left: number, top: number): number | null {
  let [nearest, least]: [number | null, number] = [null, REACH_PX * REACH_PX];
  for (const i of shown) {
    const square = (scales.x.at(x.values[i]!) - left) ** 2 + (scales.y.at(y.values[i]!) - top) ** 2;
    if (square < least) [nearest, least] = [i, square];
  }
  return nearest;
}
