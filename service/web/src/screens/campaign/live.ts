/** A campaign as it goes on: its state asked for again and again, its curves by a snapshot and the events behind it. */

import { useEffect, useRef, useState } from "preact/hooks";
import { get, Problem } from "../../api/client";
import { ended } from "../../api/ended";
import { follow, type ServerEvent } from "../../api/events";
import { paced } from "../../api/pace";
import type { Body } from "../../api/types";
import { LiveCurves, POINTS, WINDOW, type Curve } from "./curves";

type Campaign = Body<"Campaign">;
export type Found = Body<"Episode">;

const REDRAW_MS = 250; // at most four times a second, however fast the search is
const PACE_MS = 2000; // between two looks at the state
const NEWEST = 6; // failures shown

export interface Live {
  campaign?: Campaign;
  curves?: Curve[];
  /** The newest valid failures since the page was opened, or a little earlier; the newest first. */
  found: Found[];
  error?: Error;
}

/** Follows a campaign until it ends; while the tab is hidden, it asks for nothing. */
export function useLive(id: string): Live & { again: () => void } {
  const [live, setLive] = useState<Live>({ found: [] });
  const restart = useRef<() => void>(() => {});
  useEffect(() => {
    let watch: Watch | undefined;
    const look = () => {
      watch?.stop();
      watch = document.hidden ? undefined : new Watch(id, (news) => setLive((before) => ({ ...before, ...news })));
    };
    restart.current = look;
    look();
    document.addEventListener("visibilitychange", look);
    return () => {
      document.removeEventListener("visibilitychange", look);
      watch?.stop();
    };
  }, [id]);
  return { ...live, again: () => restart.current() };
}

/** One uninterrupted look at a campaign. */
class Watch {
  private left = new AbortController();
  private curves?: LiveCurves;
  private waiting: ServerEvent[] = []; // came before the snapshot
  private found = new Map<string, Found>();
  private drawing?: ReturnType<typeof setTimeout>;
  private wake: () => void = () => {};
  private following = false;

  constructor(
    private id: string,
    private tell: (news: Partial<Live>) => void,
  ) {
    this.watch();
  }

  stop(): void {
    this.left.abort();
    clearTimeout(this.drawing);
    this.wake();
  }

  private async watch(): Promise<void> {
    while (!this.left.signal.aborted) {
      const began = performance.now();
      let over = false;
      try {
        over = await this.look();
      } catch (error) {
        if (this.left.signal.aborted) return;
        this.tell({ error: error as Error });
        over = error instanceof Problem && error.status < 500; // asking again would not help
      }
      if (over) this.stop(); // the stream has nothing more to tell
      else await this.pause(paced(PACE_MS, performance.now() - began));
    }
  }

  /** Asks for the state, and for what hangs on it; says whether that was for the last time. */
  private async look(): Promise<boolean> {
    const campaign = await this.get<Campaign>("");
    this.tell({ campaign, error: undefined });
    const over = ended(campaign);
    if (!over && !this.following) this.follow(campaign);
    if (over || !this.curves) await this.snapshot(campaign);
    return over;
  }

  private async pause(forMs: number): Promise<void> {
    let timer: ReturnType<typeof setTimeout> | undefined;
    await new Promise<void>((over) => {
      this.wake = over;
      timer = setTimeout(over, forMs);
    });
    clearTimeout(timer);
  }

  /** The stream begins a little before the snapshot, so that no episode is missed and sliding rates go on from it. */
  private async follow({ runs }: Campaign): Promise<void> {
    this.following = true;
    const atWork = runs.filter((run) => run.state === "running").length;
    const newest = Math.min(1000, 2 * WINDOW * Math.max(1, atWork));
    try {
      await follow(`${this.path}/events?newest=${newest}`, (events) => this.hear(events), this.left.signal);
    } catch {
      this.following = false; // the id of the last event is not known any more: the next look begins anew
      this.curves = undefined;
    }
  }

  private async snapshot(campaign: Campaign): Promise<void> {
    const { runs } = await this.get<Body<"Curves">>(`/curves?points=${POINTS}`);
    const known = new Map(runs.map((curve) => [curve.run_id, curve]));
    this.curves = new LiveCurves(campaign.runs.filter(searches).map((run) => known.get(run.id) ?? begun(run)));
    this.curves.apply(this.waiting);
    this.waiting = [];
    this.draw();
  }

  private hear(events: ServerEvent[]): void {
    for (const { event, data } of events) {
      if (event === "failure") this.find(JSON.parse(data));
    }
    if (this.curves) this.curves.apply(events);
    else this.waiting = [...this.waiting, ...events].slice(-1000);
    this.drawing ??= setTimeout(() => this.draw(), REDRAW_MS);
    if (events.some(({ event }) => event === "state")) this.wake();
  }

  private find(failure: Found): void {
    this.found.set(failure.id, failure);
    if (this.found.size > NEWEST) this.found.delete(this.found.keys().next().value!);
  }

  private draw(): void {
    clearTimeout(this.drawing);
    this.drawing = undefined;
    const found = [...this.found.values()].reverse();
    this.tell(this.curves ? { curves: [...this.curves.runs], found } : { found });
  }

  private get path(): string {
    return `v1/campaigns/${encodeURIComponent(this.id)}`;
  }

  private get<T>(below: string): Promise<T> {
    return get<T>(this.path + below, this.left.signal);
  }
}

type Search = Body<"Run"> & Pick<Curve, "method">;

/** Whether a run searches; those of an i.i.d. phase do not, and have no curves. */
function searches(run: Body<"Run">): run is Search {
  return !run.method.startsWith("iid-");
}

/** The curve of a run without an episode. */
function begun({ id, family, method, seed, state }: Search): Curve {
  const columns = { episodes: [], window_ecr: [], window_pcr: [], distinct: [], distinct_preventable: [], dual_variable: [], mean_cost: [], driven_by: {} };
  return { run_id: id, family, method, seed, state, ...columns };
}
