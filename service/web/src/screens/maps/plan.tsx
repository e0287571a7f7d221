/** A map from above that is zoomed, dragged and clicked: its roads, and the places on it. */

import { useEffect, useMemo, useRef, useState } from "preact/hooks";
import { useAsked } from "../../api/asked";
import type { Body } from "../../api/types";
import type { Ink } from "../../stage/colours";
import { boundsOf } from "../../stage/geometry";
import { useInk } from "../../stage/ink";
import { roadPaths, type RoadPaths } from "../../stage/roads";
import { Shown } from "../../ui/states";
import { PATTERNS, type Pattern, type Spot } from "./places";
import { apartOf, hit, isLong, marksOf, panned, pixelX, pixelY, showing, whole, zoomed, type MapView, type Mark, type Size } from "./view";

type Roads = Body<"RoadsBody">;

interface Marked {
  spots: readonly Spot[];
  chosen: Spot | undefined;
  choose: (spot: Spot | undefined) => void;
}

export function Plan({ id, ...marked }: Marked & { id: string }) {
  const asked = useAsked<Roads>(`v1/networks/${encodeURIComponent(id)}/roads`);
  return (
    <figure class="card map-picture">
      <Shown asked={asked} what="the map">
        {(roads) => <Drawn roads={roads} {...marked} />}
      </Shown>
    </figure>
  );
}

const STEP = 1.5; // of a zoom by a button
const WHEEL_STEP = 0.0015;
const NEAR = 14; // pixels
const STILL = 4; // pixels that a click may move
const DRAG = 60; // pixels of an arrow key

function Drawn({ roads, spots, chosen, choose }: Marked & { roads: Roads }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const ink = useInk();
  const bounds = useMemo(() => boundsOf(roads.surfaces.flatMap(({ outline }) => outline as [number, number][])) ?? { left: 0, right: 1, bottom: 0, top: 1 }, [roads]);
  const paths = useMemo(() => roadPaths(roads), [roads]);
  const marks = useMemo(() => marksOf(spots), [spots]);
  const long = isLong(bounds);
  const [apart, setApart] = useState(long);
  const [size, setSize] = useState<Size>({ width: 0, height: 0 });
  const [view, setView] = useState<MapView>();
  useEffect(() => {
    const measure = () => setSize({ width: canvas.current!.clientWidth, height: canvas.current!.clientHeight });
    const resized = new ResizeObserver(measure);
    resized.observe(canvas.current!);
    return () => resized.disconnect();
  }, []);
  useEffect(() => {
    if (size.width > 0) setView((before) => before ?? whole(bounds, size, apart));
  }, [size, bounds]);
  useEffect(() => {
    if (chosen && size.width > 0) setView((before) => before && showing(before, size, chosen));
  }, [chosen]);
  useEffect(() => {
    if (view && size.width > 0) draw(canvas.current!, { view, size, ink, paths, marks, chosen });
  }, [view, size, ink, paths, marks, chosen]);
  const change = (next: (before: MapView) => MapView) => setView((before) => before && next(before));
  const zoom = (factor: number) => change((before) => zoomed(before, size, factor, size.width / 2, size.height / 2));
  const show = (wanted: boolean) => {
    setApart(wanted);
    setView(whole(bounds, size, wanted));
  };
  useGestures(canvas, size, change, (px, py) => view && choose(hit(marks, view, size, { px, py }, NEAR)));
  const keyed = (event: KeyboardEvent) => {
    const act = KEYS[event.key];
    if (!act || event.ctrlKey || event.metaKey) return;
    event.preventDefault();
    change((before) => act(before, size));
  };
  return (
    <>
      <div class="row map-tools">
        <span class="joined" role="group" aria-label="Zoom">
          <button aria-label="Farther" onClick={() => zoom(1 / STEP)}>
            −
          </button>
          <button aria-label="Nearer" onClick={() => zoom(STEP)}>
            +
          </button>
          <button onClick={() => show(apart)}>Whole map</button>
        </span>
        {long && (
          <label class="check">
            <input type="checkbox" checked={apart} onChange={() => show(!apart)} /> stretch it across
          </label>
        )}
        {view && <Scale view={view} />}
      </div>
      <canvas ref={canvas} class="map-plan" tabIndex={0} role="group" aria-label="The map from above" data-places={spots.length} onKeyDown={keyed} />
      <figcaption class="row small faint">
        {PATTERNS.map(({ name, title }) => (
          <span key={name} class="map-sign">
            <Sign pattern={name} /> {title}
          </span>
        ))}
        <span class="map-sign">
          <Sign pattern={null} /> does not fit
        </span>
        <span>Drag it, turn the wheel or pinch to zoom; click a mark to find its line.</span>
      </figcaption>
    </>
  );
}

const KEYS: Record<string, (view: MapView, size: Size) => MapView> = {
  ArrowLeft: (view) => panned(view, DRAG, 0),
  ArrowRight: (view) => panned(view, -DRAG, 0),
  ArrowUp: (view) => panned(view, 0, DRAG),
  ArrowDown: (view) => panned(view, 0, -DRAG),
  "+": (view, size) => zoomed(view, size, STEP, size.width / 2, size.height / 2),
  "-": (view, size) => zoomed(view, size, 1 / STEP, size.width / 2, size.height / 2),
};

/** The length of a bar, and what is drawn larger across. */
function Scale({ view }: { view: MapView }) {
  const { times, axis } = apartOf(view);
  const along = axis === "y" ? view.scaleX : view.scaleY;
  const room_m = 100 / along;
  const power = 10 ** Math.floor(Math.log10(room_m));
  const length_m = [5, 2, 1].map((each) => each * power).find((each) => each <= room_m)!;
  return (
    <span class="small faint map-scale">
      <span class="map-bar" style={{ width: `${length_m * along}px` }} /> {length_m >= 1000 ? `${length_m / 1000} km` : `${length_m} m`}
      {times > 1.05 && `; ${axis === "y" ? "north to south" : "west to east"} it is drawn ${times < 10 ? times.toFixed(1) : Math.round(times)} times as large`}
    </span>
  );
}

/** Dragging moves the ground, wheel and pinch zoom; a click that moves nothing is told. */
function useGestures(canvas: { current: HTMLCanvasElement | null }, size: Size, change: (next: (before: MapView) => MapView) => void, click: (px: number, py: number) => void) {
  const latest = useRef({ size, click });
  latest.current = { size, click };
  useEffect(() => {
    const element = canvas.current!;
    const left = new AbortController();
    const down = new Map<number, { px: number; py: number }>();
    let moved = 0;
    const at = (event: PointerEvent | WheelEvent) => ({ px: event.offsetX, py: event.offsetY });
    const on = <K extends "pointerdown" | "pointermove" | "pointerup" | "pointercancel">(name: K, act: (event: PointerEvent) => void) => element.addEventListener(name, act, { signal: left.signal });
    on("pointerdown", (event) => {
      element.setPointerCapture(event.pointerId);
      if (down.size === 0) moved = 0;
      down.set(event.pointerId, at(event));
    });
    on("pointermove", (event) => {
      const before = down.get(event.pointerId);
      if (!before) return;
      const now = at(event);
      const [dx, dy] = [now.px - before.px, now.py - before.py];
      const other = [...down].find(([pointer]) => pointer !== event.pointerId)?.[1];
      down.set(event.pointerId, now);
      moved += Math.hypot(dx, dy);
      if (!other) return change((view) => panned(view, dx, dy));
      const factor = Math.hypot(now.px - other.px, now.py - other.py) / Math.max(1, Math.hypot(before.px - other.px, before.py - other.py));
      change((view) => panned(zoomed(view, latest.current.size, factor, (before.px + other.px) / 2, (before.py + other.py) / 2), dx / 2, dy / 2));
    });
    on("pointerup", (event) => {
      down.delete(event.pointerId);
      const { px, py } = at(event);
      if (down.size === 0 && moved < STILL) latest.current.click(px, py);
    });
    on("pointercancel", (event) => void down.delete(event.pointerId));
    const wheel = (event: WheelEvent) => {
      event.preventDefault();
      const { px, py } = at(event);
      change((view) => zoomed(view, latest.current.size, Math.exp(-event.deltaY * WHEEL_STEP), px, py));
    };
    element.addEventListener("wheel", wheel, { signal: left.signal, passive: false });
    return () => left.abort();
  }, []);
}

const COLOURS: Record<Pattern, keyof Ink & `--series-${number}`> = { car_following: "--series-1", crossing: "--series-2", junction: "--series-3" };
const MOST_DENSE = 2;
const NAMED = 12; // places in sight that are named at once

interface Scene {
  view: MapView;
  size: Size;
  ink: Ink;
  paths: RoadPaths;
  marks: readonly Mark<Spot>[];
  chosen: Spot | undefined;
}

function draw(canvas: HTMLCanvasElement, { view, size, ink, paths, marks, chosen }: Scene): void {
  const density = Math.min(devicePixelRatio, MOST_DENSE);
  canvas.width = Math.round(size.width * density);
  canvas.height = Math.round(size.height * density);
  const ctx = canvas.getContext("2d", { alpha: false })!;
  ctx.scale(density, density);
  ctx.fillStyle = ink["--ground"];
  ctx.fillRect(0, 0, size.width, size.height);
  const onto = new DOMMatrix([view.scaleX, 0, 0, -view.scaleY, pixelX(view, size, 0), pixelY(view, size, 0)]);
  const ground = [["sidewalks", "--sidewalk"], ["junctions", "--crossing"], ["lanes", "--crossing"], ["crossings", "--road"]] as const;
  for (const [name, colour] of ground) {
    const path = new Path2D();
    path.addPath(paths[name], onto);
    ctx.fillStyle = ink[colour];
    ctx.fill(path);
    ctx.lineWidth = 0.6; // a road that is thinner than a pixel is seen, too
    ctx.strokeStyle = name === "lanes" || name === "junctions" ? ink["--faint"] : ink[colour];
    if (name !== "junctions") ctx.stroke(path);
  }
  const at = ({ point, aside }: Mark<Spot>) => [pixelX(view, size, point.x_m) + aside, pixelY(view, size, point.y_m)] as const;
  const inSight = marks.filter((mark) => isInside(...at(mark), size));
  for (const mark of inSight.toReversed()) drawMark(ctx, patternOf(mark.point), ...at(mark), ink);
  const named = inSight.length <= NAMED ? inSight.map(({ point }) => point) : chosen ? [chosen] : [];
  ctx.font = "12px system-ui, sans-serif";
  ctx.lineWidth = 3;
  for (const place of new Map(named.map((spot) => [spot.place, spot])).values()) {
    const [px, py] = [Math.min(pixelX(view, size, place.x_m) + 10, size.width - ctx.measureText(place.place).width - 4), pixelY(view, size, place.y_m) - 10];
    ctx.strokeStyle = ink["--ground"];
    ctx.strokeText(place.place, px, py);
    ctx.fillStyle = ink["--text"];
    ctx.fillText(place.place, px, py);
  }
  const ringed = marks.find(({ point }) => point === chosen);
  if (!ringed) return;
  ctx.strokeStyle = ink["--text"];
  ctx.lineWidth = 2.5;
  ctx.beginPath();
  ctx.arc(...at(ringed), 11, 0, 2 * Math.PI);
  ctx.stroke();
}

function isInside(px: number, py: number, { width, height }: Size): boolean {
  return px > -10 && px < width + 10 && py > -10 && py < height + 10;
}

function patternOf(spot: Spot): Pattern | null {
  return "summary" in spot ? spot.pattern : null;
}

function drawMark(ctx: CanvasRenderingContext2D, pattern: Pattern | null, px: number, py: number, ink: Ink): void {
  ctx.lineWidth = 1;
  const path = new Path2D();
  path.addPath(new Path2D(SIGNS[pattern ?? "none"]), new DOMMatrix([1, 0, 0, 1, px, py]));
  if (pattern === null) {
    ctx.strokeStyle = ink["--faint"];
    return ctx.stroke(path);
  }
  ctx.fillStyle = ink[COLOURS[pattern]];
  ctx.strokeStyle = ink["--ground"];
  ctx.fill(path);
  ctx.stroke(path);
}

/** Around its middle, in pixels: a circle, a square, a triangle, a cross. */
const SIGNS = {
  car_following: "M6 0A6 6 0 1 1 -6 0A6 6 0 1 1 6 0Z",
  crossing: "M-5 -5H5V5H-5Z",
  junction: "M0 -7L7 5H-7Z",
  none: "M-3 -3L3 3M-3 3L3 -3",
};

export function Sign({ pattern }: { pattern: Pattern | null }) {
  return (
    <svg class={`sign sign-${pattern ?? "none"}`} width="16" height="16" viewBox="-8 -8 16 16" aria-hidden="true">
      <path d={SIGNS[pattern ?? "none"]} />
    </svg>
  );
}
