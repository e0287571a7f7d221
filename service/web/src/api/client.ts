/** Calls of the API: the key goes along, problems become errors, and a lost connection is known to the whole page. */

import { signal } from "../signal";
import type { Body } from "./types";

const KEY = "risk-sac-key";
const BASE = new URL("../", new URL(".", document.baseURI)).href; // the page lies in `page/`, the API beside it

/** Whether a key is wanted, and whether the server answers: what the shell shows, whatever the screen. */
export const wantsKey = signal(false);
export const connected = signal(true);

/** The API refused; `message` says why in words that can be shown. */
export class Problem extends Error {
  constructor(
    readonly status: number,
    readonly reason: string,
    message: string,
    readonly errors: Body<"FieldProblem">[] = [],
  ) {
    super(message);
  }
}

/** Kept for this tab alone, and gone with it. */
export function setKey(key: string | null): void {
  if (key === null) sessionStorage.removeItem(KEY);
  else sessionStorage.setItem(KEY, key);
  wantsKey.set(key === null);
}

export function hasKey(): boolean {
  return sessionStorage.getItem(KEY) !== null;
}

/** A call by its path from the API's root, such as `v1/campaigns`, or by an answer's link; throws a Problem, or a TypeError if the service does not answer. */
export async function call(path: string, init: RequestInit = {}): Promise<Response> {
  const headers = new Headers(init.headers);
  const key = sessionStorage.getItem(KEY);
  if (key !== null && !headers.has("Authorization")) headers.set("Authorization", `Bearer ${key}`);
  let response: Response;
  try {
    response = await fetch(new URL(path, BASE), { ...init, headers });
  } catch (error) {
    if (!init.signal?.aborted) connected.set(false);
    throw error;
  }
  connected.set(true);
  if (response.ok || response.status === 304) return response;
  if (response.status === 401) wantsKey.set(true);
  throw await problemOf(response);
}

export async function get<T>(path: string, signal?: AbortSignal): Promise<T> {
  return (await call(path, { signal })).json();
}

export async function send<T>(method: "POST" | "PUT" | "DELETE", path: string, body?: unknown): Promise<T | null> {
  const init: RequestInit = { method };
  if (body !== undefined) {
    init.body = JSON.stringify(body);
    init.headers = { "Content-Type": "application/json" };
  }
  const response = await call(path, init);
  return response.status === 204 ? null : response.json();
}

/** Address of the same call for a shell, or for a program that the user runs. */
export function absolute(path: string): string {
  return BASE + path;
}

/** Saves an answer as a file; by a call and not by a link, since a link cannot carry the key. */
export async function download(path: string, name: string): Promise<void> {
  save(await (await call(path)).blob(), name);
}

export function save(content: Blob, name: string): void {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(content);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
}

async function problemOf(response: Response): Promise<Problem> {
  const body = await response.json().catch(() => null);
  const detail = body?.detail ?? body?.title ?? `the service answered ${response.status}`;
  return new Problem(response.status, body?.reason ?? "", detail, body?.errors ?? []);
}
