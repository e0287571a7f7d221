/** Requests that wait for each other, for work that the service does a few at a time. */

export type Turn = <T>(act: () => Promise<T>) => Promise<T>;

/** Returns a queue: each act begins when the one before has ended, whether it succeeded or not. */
export function queue(): Turn {
  let last: Promise<unknown> = Promise.resolve();
  return (act) => {
    const next = last.then(act);
    last = next.catch(() => undefined);
    return next;
  };
}
