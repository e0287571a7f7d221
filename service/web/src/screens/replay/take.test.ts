import { expect, it, vi } from "vitest";

vi.mock("../../api/client", () => ({ absolute: (path: string) => `http://host/${path}`, hasKey: () => false, download: vi.fn(), save: vi.fn() }));
const { quoted, replayCommand } = await import("./take");
const { fileName } = await import("./exports");

it("a word of a shell stays one word", () => {
  expect(quoted("low-archive-601-search-28")).toBe("low-archive-601-search-28");
  expect(quoted("a b;rm -rf ~")).toBe("'a b;rm -rf ~'");
  expect(quoted("it's $HOME")).toBe("'it'\\''s $HOME'");
});

it("the command fetches the bundle and plays it", () => {
  expect(replayCommand("v1/campaigns/c/failures/f", "f")).toBe("curl -sSf http://host/v1/campaigns/c/failures/f/bundle.npz -o f.npz && risk-sac replay f.npz");
});

it("an export is called as the service calls it", () => {
  expect(fileName("low-a-1-search-2", { name: "gif", suffix: ".gif" })).toBe("low-a-1-search-2.gif");
  expect(fileName("low-a-1-search-2", { name: "sumo", suffix: ".zip" })).toBe("low-a-1-search-2-sumo.zip");
});
