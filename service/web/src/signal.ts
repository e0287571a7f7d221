/** A value that components follow. */

import { useEffect, useState } from "preact/hooks";

export interface Signal<T> {
  get(): T;
  set(value: T): void;
  /** Calls back on each change; returns how to leave off. */
  on(changed: () => void): () => void;
}

export function signal<T>(value: T): Signal<T> {
  const followers = new Set<() => void>();
  return {
    get: () => value,
    set(next) {
      if (Object.is(next, value)) return;
      value = next;
      followers.forEach((changed) => changed());
    },
    on(changed) {
      followers.add(changed);
      return () => followers.delete(changed);
    },
  };
}

export function useSignal<T>(followed: Signal<T>): T {
  const [, again] = useState(0);
  useEffect(() => followed.on(() => again((n) => n + 1)), [followed]);
  return followed.get();
}
