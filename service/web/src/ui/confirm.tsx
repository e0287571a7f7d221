/** Asks before something that cannot be taken back; the browser's own dialog keeps the focus and closes on Escape. */

import type { ComponentChildren } from "preact";
import { useId, useLayoutEffect, useRef, useState } from "preact/hooks";
import "./confirm.css";

interface Question {
  title: string;
  /** What it says on the button that does it. */
  verb: string;
  children: ComponentChildren;
  act: () => Promise<void>;
  close: () => void;
}

export function Confirm({ title, verb, children, act, close }: Question) {
  const dialog = useRef<HTMLDialogElement>(null);
  const heading = useId();
  const [busy, setBusy] = useState(false);
  const [refused, setRefused] = useState("");
  useLayoutEffect(() => dialog.current!.showModal(), []);
  const confirmed = async () => {
    setBusy(true);
    try {
      await act();
      close();
    } catch (error) {
      setRefused((error as Error).message);
      setBusy(false);
    }
  };
  return (
    <dialog ref={dialog} class="card confirm" aria-labelledby={heading} onClose={close}>
      <h2 id={heading}>{title}</h2>
      {children}
      {refused && (
        <p class="bad" role="alert">
          {refused}
        </p>
      )}
      <div class="row confirm-choice">
        <button autofocus onClick={close}>
          Keep it
        </button>
        <button class="danger" disabled={busy} onClick={confirmed}>
          {verb}
        </button>
      </div>
    </dialog>
  );
}
