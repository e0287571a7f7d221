import { describe, expect, it } from "vitest";
import type { Listed } from "./listed";
import { clicked, orderOf, sorted, textOf } from "./order";
import { path, spark } from "./spark";

const listed = (id: string, ecr: number | null, created: string): Listed =>
  ({ id, label: "", created_at: created, progress: { window_ecr: ecr } }) as Listed;

describe("the order of the list", () => {
  const campaigns = [listed("b", 0.1, "2026-01-02"), listed("a", null, "2026-01-03"), listed("c", 0.3, "2026-01-01")];
  const ids = (order: string | null) => sorted(campaigns, orderOf(order)).map(({ id }) => id).join("");

  it("is newest first until the address says otherwise", () => {
    expect(ids(null)).toBe("abc");
    expect(ids("nonsense")).toBe("abc");
    expect(ids("constructor")).toBe("abc");
    expect(ids("created")).toBe("cba");
    expect(ids("label")).toBe("abc");
  });

  it("puts what is unknown last, whichever way", () => {
    expect(ids("ecr")).toBe("bca");
    expect(ids("-ecr")).toBe("cba");
  });

  it("turns around at the second click", () => {
    const once = clicked(orderOf(null), "ecr");
    expect(textOf(once)).toBe("-ecr");
    expect(textOf(clicked(once, "ecr"))).toBe("ecr");
    expect(textOf(clicked(orderOf(null), "label"))).toBe("label");
    expect(textOf(orderOf(null))).toBeUndefined();
  });
});

describe("a sparkline", () => {
  const run = (episodes: number[], window_ecr: (number | null)[]) => ({ episodes, window_ecr });

  it("is the mean over the runs that had begun", () => {
    const line = spark([run([1, 2, 4], [0, 0.2, 0.4]), run([2, 4], [0.4, null])], 4);
    expect(line.x).toEqual([0.25, 0.5, 0.75, 1]);
    expect(line.mean[0]).toBe(0);
    expect(line.mean[1]).toBeCloseTo(0.3);
    expect(line.mean[2]).toBeCloseTo(0.3);
    expect(line.mean[3]).toBeCloseTo(0.4);
  });

  it("is empty before the first episode", () => {
    expect(spark([], 30).x).toEqual([]);
    expect(spark([run([], [])], 30).x).toEqual([]);
    expect(path({ x: [], mean: [] }, 10, 10, 0.1)).toBe("");
  });

  it("reaches the top with its largest value, but not with a small one", () => {
    expect(path({ x: [0, 1], mean: [0, 0.5] }, 10, 20, 0.1)).toBe("M0.0 20.0L10.0 0.0");
    expect(path({ x: [0, 1], mean: [0, 0.05] }, 10, 20, 0.1)).toBe("M0.0 20.0L10.0 10.0");
  });
});
