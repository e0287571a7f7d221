/** What stands where a twin will be: it is played when it is asked for, which takes seconds. */

import { useEffect, useState } from "preact/hooks";
import { Problem } from "../../api/client";
import { Failed } from "../../ui/states";

const CONFLICT = 409;

export function Waiting({ error, again }: { error: Error | undefined; again: () => void }) {
  if (error instanceof Problem && error.status === CONFLICT)
    return (
      <div class="state" role="status">
        <p>This twin cannot be played.</p>
        <p>{error.message}</p>
      </div>
    );
  if (error !== undefined) return <Failed error={error} again={again} />;
  return (
    <p class="state">
      <span class="spinner" aria-hidden="true" /> <span role="status">Playing the twin …</span> <Elapsed />
    </p>
  );
}

function Elapsed() {
  const [seconds, setSeconds] = useState(0);
  useEffect(() => {
    const timer = setInterval(() => setSeconds((n) => n + 1), 1000);
    return () => clearInterval(timer);
  }, []);
  return <span aria-hidden="true">{seconds} s</span>;
}
