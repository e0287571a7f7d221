/** A canvas that fills its box, sharp on any screen, drawn anew when the box or what it shows changes. */

import type { RefObject } from "preact";
import { useEffect, useLayoutEffect, useState } from "preact/hooks";

export interface Size {
  width: number;
  height: number;
}

/** The size of an element, as the layout gives it. */
export function useSize(element: RefObject<HTMLElement>): Size {
  const [size, setSize] = useState<Size>({ width: 0, height: 0 });
  useLayoutEffect(() => {
    const measure = () => {
      const { clientWidth: width, clientHeight: height } = element.current!;
      setSize((before) => (before.width === width && before.height === height ? before : { width, height }));
    };
    measure();
    const observer = new ResizeObserver(measure);
    observer.observe(element.current!);
    return () => observer.disconnect();
  }, []);
  return size;
}

export type Paint = (context: CanvasRenderingContext2D, ratio: number) => void;

/** Draws when one of `on` changes, in the next frame; several changes are drawn once. */
export function usePaint(canvas: RefObject<HTMLCanvasElement>, { width, height }: Size, paint: Paint, on: unknown[]): void {
  useEffect(() => {
    if (!width || !height) return;
    const frame = requestAnimationFrame(() => {
      const ratio = devicePixelRatio || 1;
      const [wide, high] = [Math.round(width * ratio), Math.round(height * ratio)];
      const element = canvas.current!;
      if (element.width !== wide) element.width = wide;
      if (element.height !== high) element.height = high;
      const context = element.getContext("2d")!;
      context.setTransform(ratio, 0, 0, ratio, 0, 0);
      context.clearRect(0, 0, width, height);
      paint(context, ratio);
    });
    return () => cancelAnimationFrame(frame);
  }, [width, height, ...on]);
}
