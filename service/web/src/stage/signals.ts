/** Signal heads on the ground: a bar across each lane, whose middle is open on green. */

import type { Body } from "../api/types";
import { pixelX, pixelY, type Scene } from "./scene";

export type Signal = Body<"SignalHeadBody">;
export type Lamp = Signal["changes"][number][1];

/** As style.css has them for legends. */
export const LAMP_COLOURS: Record<Lamp, string> = { red: "#e5484d", yellow: "#f5b700", green: "#30a46c", off: "#808080" };
const OPEN = 0.25; // share of the lane's width that a green bar covers from each side
const A_MOMENT_S = 1e-6;

/** The colour that a signal shows at a time by the clock of the series. */
export function lampAt({ changes }: Pick<Signal, "changes">, time_s: number): Lamp {
  const begun = changes.filter(([at]) => at < time_s - A_MOMENT_S);
  return (begun.at(-1) ?? changes[0])?.[1] ?? "off";
}

/** What each signal shows in the scene's picture. */
export function shownIn({ roads, recording, time_s }: Scene): { signal: Signal; lamp: Lamp }[] {
  const clock_s = time_s + (recording.series.released_s - recording.released_s);
  return (roads?.signals ?? []).map((signal) => ({ signal, lamp: lampAt(signal, clock_s) }));
}

export function drawSignals(scene: Scene): void {
  const { ctx, camera, ink } = scene;
  ctx.save();
  for (const { signal, lamp } of shownIn(scene)) {
    const [x, y] = [pixelX(scene, signal.x_m), pixelY(scene, signal.y_m)];
    const half = (signal.width_m * camera.scale) / 2;
    const [acrossX, acrossY] = [Math.sin(signal.heading_rad) * half, Math.cos(signal.heading_rad) * half];
    ctx.beginPath();
    for (const [from, to] of lamp === "green" ? [[-1, 2 * OPEN - 1], [1 - 2 * OPEN, 1]] as const : [[-1, 1]] as const) {
      ctx.moveTo(x + from * acrossX, y + from * acrossY);
      ctx.lineTo(x + to * acrossX, y + to * acrossY);
    }
    ctx.strokeStyle = ink["--ground"];
    ctx.lineWidth = 6;
    ctx.stroke();
    ctx.strokeStyle = LAMP_COLOURS[lamp];
    ctx.lineWidth = 4;
    ctx.stroke();
  }
  ctx.restore();
}
