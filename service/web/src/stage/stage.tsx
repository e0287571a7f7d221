/** The view from above: a canvas that follows a clock and a camera. */

import { useEffect, useRef } from "preact/hooks";
import type { Followed, Tripod } from "./camera";
import type { Clock } from "./clock";
import { keepDrawn } from "./drawn";
import { useInk } from "./ink";
import { instantAt, posesAt } from "./interpolate";
import { drawPicture } from "./picture";
import type { Recording } from "./recording";
import type { RoadPaths } from "./roads";
import type { Layers, Scene, Sensor } from "./scene";

const WHEEL_STEP = 0.0015;
const MOST_DENSE = 2; // more pixels cost time and show nothing more

interface Props {
  recording: Recording;
  original?: boolean;
  roads: RoadPaths | null;
  sensor: Sensor | null;
  clock: Clock;
  tripod: Tripod;
  layers: Layers;
  label: string;
  /** The road user to follow, by default the recording's ego: stages that share a camera follow the same. */
  followed?: (time: number) => Followed;
}

export function Stage(props: Props) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const ink = useInk();
  const latest = useRef(props);
  latest.current = props;
  const redraw = useRef(() => {});

  useEffect(() => {
    const element = canvas.current!;
    const { recording, clock, tripod } = props;
    const scene: Scene = {
      ctx: element.getContext("2d", { alpha: false })!,
      view: { width: 0, height: 0 },
      density: 1,
      camera: tripod.camera.get(),
      ink,
      layers: props.layers,
      recording,
      original: props.original ?? true,
      sensor: props.sensor,
      roads: props.roads,
      time_s: 0,
      instant: { index: 0, share: 0 },
      poses: new Float64Array(3 * recording.actors),
      labels: [],
    };
    const sides = new Int8Array(recording.actors);
    const draw = () => {
      if (scene.view.width === 0) return;
      const { layers, sensor, roads, followed } = latest.current;
      scene.time_s = clock.time.get();
      scene.instant = instantAt(recording.time_s, scene.time_s);
      posesAt(recording, scene.instant, scene.poses);
      scene.camera = tripod.at(scene.view, followed ? followed(scene.time_s) : egoOf(scene));
      Object.assign(scene, { layers, sensor, roads });
      drawPicture(scene, sides);
      keepDrawn(element, scene);
    };
    const measure = () => {
      const { clientWidth: width, clientHeight: height } = element;
      scene.view = { width, height };
      scene.density = Math.min(devicePixelRatio, MOST_DENSE);
      element.width = Math.round(width * scene.density);
      element.height = Math.round(height * scene.density);
      tripod.measured(scene.view);
      draw();
    };
    const resized = new ResizeObserver(measure);
    resized.observe(element);
    measure();
    redraw.current = draw;
    const leave = [clock.time.on(draw), tripod.camera.on(draw), tripod.follow.on(draw), moved(element, tripod)];
    return () => {
      resized.disconnect();
      leave.forEach((off) => off());
    };
  }, [props.recording, props.clock, props.tripod, ink]);

  useEffect(() => redraw.current(), [props.layers, props.sensor, props.roads]);

  return <canvas ref={canvas} class="stage" role="img" aria-label={props.label} />;
}

function egoOf({ poses }: Scene): Followed {
  return { x: poses[0]!, y: poses[1]!, heading: poses[2]! };
}

/** Dragging moves the ground, the wheel zooms to where it points. */
function moved(canvas: HTMLCanvasElement, tripod: Tripod): () => void {
  const drag = (event: PointerEvent) => {
    if (event.buttons === 1) tripod.pan(event.movementX, event.movementY);
  };
  const grab = (event: PointerEvent) => canvas.setPointerCapture(event.pointerId);
  const wheel = (event: WheelEvent) => {
    event.preventDefault();
    tripod.zoom(Math.exp(-event.deltaY * WHEEL_STEP), event.offsetX, event.offsetY);
  };
  canvas.addEventListener("pointerdown", grab);
  canvas.addEventListener("pointermove", drag);
  canvas.addEventListener("wheel", wheel, { passive: false });
  return () => {
    canvas.removeEventListener("pointerdown", grab);
    canvas.removeEventListener("pointermove", drag);
    canvas.removeEventListener("wheel", wheel);
  };
}
