/** Asks before something is done that cannot be undone. */

import type { ComponentChildren } from "preact";
import { useEffect, useRef, useState } from "preact/hooks";

interface Question {
  title: string;
  /** What it does, on the button. */
  yes: string;
  children: ComponentChildren;
  act: () => Promise<unknown>;
  close: () => void;
}

export function Confirm({ title, yes, children, act, close }: Question) {
  const dialog = useRef<HTMLDialogElement>(null);
  const [busy, setBusy] = useState(false);
  const [refused, setRefused] = useState("");
  useEffect(() => dialog.current!.showModal(), []);
  const go = async () => {
    setBusy(true);
    try {
      await act();
      close();
    } catch (error) {
      setRefused(error instanceof TypeError ? "The service does not answer." : (error as Error).message);
      setBusy(false);
    }
  };
  return (
    <dialog ref={dialog} class="card confirm" aria-labelledby="confirm-title" onClose={close}>
      <h2 id="confirm-title">{title}</h2>
      {children}
      {refused && (
        <p class="bad" role="alert">
          {refused}
        </p>
      )}
      <div class="row">
        <button class="danger" onClick={go} disabled={busy}>
          {yes}
        </button>
        <button onClick={() => dialog.current!.close()} autofocus>
          Not now
        </button>
      </div>
    </dialog>
  );
}
