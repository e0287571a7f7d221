/** The sparkline of a campaign, asked for once its row comes to sight. */

import { useEffect, useRef, useState } from "preact/hooks";
import { get } from "../../api/client";
import { ended } from "../../api/ended";
import { usePolled } from "../../api/polled";
import type { Body } from "../../api/types";
import { percent } from "../../ui/text";
import type { Listed } from "./listed";
import { path, spark, type Spark } from "./spark";

const WIDTH = 96;
const HEIGHT = 22;
const POINTS = 30;
const LEAST_TOP = 0.1; // an ECR of a few per cent shall not look like one of a hundred
const AGAIN_MS = 5000;

/** @param learners methods that learn; the others are controls, which count only where there is nothing else. */
export function Sparkline({ campaign, learners }: { campaign: Listed; learners: readonly string[] }) {
  const place = useRef<HTMLSpanElement>(null);
  const seen = useSeen(place);
  const [curves, setCurves] = useState<Body<"Curves">>();
  usePolled(seen ? campaign.id : null, async (left) => {
    try {
      setCurves(await get<Body<"Curves">>(`v1/campaigns/${campaign.id}/curves?points=${POINTS}`, left));
    } catch {
      return null; // the number beside it says as much; a lost connection is the list's to tell
    }
    return ended(campaign) ? null : AGAIN_MS;
  });
  const searching = curves?.runs.filter((run) => learners.includes(run.method)) ?? [];
  const line = curves && spark(searching.length ? searching : curves.runs, POINTS);
  return (
    <span class="spark" ref={place}>
      {line && line.x.length > 1 && <Line line={line} />}
    </span>
  );
}

function Line({ line }: { line: Spark }) {
  const drawn = path(line, WIDTH, HEIGHT - 2, LEAST_TOP);
  const said = `ECR over the episodes, from ${percent(line.mean[0])} to ${percent(line.mean.at(-1))}`;
  return (
    <svg width={WIDTH} height={HEIGHT} viewBox={`0 -1 ${WIDTH} ${HEIGHT}`} role="img" aria-label={said}>
      <path class="spark-area" d={`${drawn}L${WIDTH * line.x.at(-1)!} ${HEIGHT - 2}L${WIDTH * line.x[0]!} ${HEIGHT - 2}Z`} />
      <path class="spark-line" d={drawn} />
    </svg>
  );
}

function useSeen(place: { current: Element | null }): boolean {
  const [seen, setSeen] = useState(false);
  useEffect(() => {
    const observer = new IntersectionObserver((entries) => {
      if (!entries.some((entry) => entry.isIntersecting)) return;
      setSeen(true);
      observer.disconnect();
    });
    observer.observe(place.current!);
    return () => observer.disconnect();
  }, []);
  return seen;
}
