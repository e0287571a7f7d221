/** The time that is shown, for all that follows it; it runs with the screen's frames. */

import { useEffect, useState } from "preact/hooks";
import { signal } from "../signal";
import { instantAt } from "./interpolate";

export const RATES = [0.1, 0.25, 0.5, 1, 2, 4];
const LONGEST_MS = 100; // a tab that slept does not jump

/** The time after so many milliseconds of the wall clock, no later than the end. */
export function advanced(time: number, elapsedMs: number, rate: number, end: number): number {
  return Math.min(time + (Math.min(elapsedMs, LONGEST_MS) / 1000) * rate, end);
}

/** The frame so many frames on; from between two frames, the next one in that direction is the first. */
export function stepped(times: ArrayLike<number>, time: number, by: number): number {
  const { index, share } = instantAt(times, time);
  const from = share > 0 && by < 0 ? index + 1 : index;
  return times[Math.min(Math.max(from + by, 0), times.length - 1)]!;
}

export class Clock {
  readonly time;
  readonly playing = signal(false);
  readonly rate = signal(1);
  readonly start: number;
  readonly end: number;
  private frame = 0;
  private before = 0;

  /** @param times of the frames, rising. */
  constructor(
    readonly times: ArrayLike<number>,
    at: number,
  ) {
    this.start = times[0] ?? 0;
    this.end = times[times.length - 1] ?? 0;
    this.time = signal(this.within(at));
  }

  seek(time: number): void {
    if (Number.isFinite(time)) this.time.set(this.within(time));
  }

  step(by: number): void {
    this.pause();
    this.time.set(stepped(this.times, this.time.get(), by));
  }

  /** From the beginning, if it has come to the end. */
  play(): void {
    if (this.playing.get()) return;
    if (this.time.get() >= this.end) this.time.set(this.start);
    this.playing.set(true);
    this.before = performance.now();
    this.frame = requestAnimationFrame(this.tick);
  }

  pause(): void {
    cancelAnimationFrame(this.frame);
    this.playing.set(false);
  }

  toggle(): void {
    if (this.playing.get()) this.pause();
    else this.play();
  }

  /** One rate slower or faster. */
  pace(by: number): void {
    const next = RATES.indexOf(this.rate.get()) + by;
    this.rate.set(RATES[Math.min(Math.max(next, 0), RATES.length - 1)]!);
  }

  private within(time: number): number {
    return Math.min(Math.max(time, this.start), this.end);
  }

  private tick = (now: number) => {
    this.time.set(advanced(this.time.get(), Math.max(now - this.before, 0), this.rate.get(), this.end));
    this.before = now;
    if (this.time.get() >= this.end) this.pause();
    else this.frame = requestAnimationFrame(this.tick);
  };
}

const LAZY_MS = 250;

/** The time for what is read and not watched: while it plays, it changes four times a second. */
export function useLazyTime(clock: Clock): number {
  const [time, setTime] = useState(clock.time.get());
  useEffect(() => {
    let shown = 0;
    const changed = () => {
      const now = performance.now();
      if (clock.playing.get() && now - shown < LAZY_MS) return;
      shown = now;
      setTime(clock.time.get());
    };
    changed();
    const leave = [clock.time.on(changed), clock.playing.on(changed)];
    return () => leave.forEach((off) => off());
  }, [clock]);
  return time;
}
