/** Triage: what a person made of a failure. It is shown at once, and taken back if the service refuses it. */

import { useLayoutEffect, useRef, useState } from "preact/hooks";
import { useAsked } from "../../api/asked";
import { send } from "../../api/client";
import { Failed, Loading } from "../../ui/states";
import { moment } from "../../ui/text";
import { TRIAGE } from "./naming";
import type { FailureTable, Note, Triage, TriageState } from "./wire";

const LONGEST = 2000;

/** What was noted here since the table was read, by failure. */
export type Notes = ReadonlyMap<string, TriageState>;

/** The table with the notes in it; the same table where there are none. */
export function noted(table: FailureTable, notes: Notes): FailureTable {
  if (!notes.size) return table;
  return { ...table, triage: table.triage.map((state, i) => notes.get(table.ids[i]!) ?? state) };
}

interface Refused {
  failure: string;
  triage: Note;
  error: Error;
}

export interface Noting {
  notes: Notes;
  /** What the service refused last, to be mended and sent again. */
  refused: Refused | null;
  save: (failure: string, triage: Note) => void;
  forgive: () => void;
}

export function useNoting(campaign: string): Noting {
  const [notes, setNotes] = useState<Notes>(new Map());
  const [refused, setRefused] = useState<Refused | null>(null);
  const note = (failure: string, state: TriageState | undefined) =>
    setNotes((before) => {
      const next = new Map(before);
      if (state === undefined) next.delete(failure);
      else next.set(failure, state);
      return next;
    });
  const save = async (failure: string, triage: Note) => {
    const before = notes.get(failure);
    setRefused(null);
    note(failure, triage.state);
    try {
      await send("PUT", `v1/campaigns/${encodeURIComponent(campaign)}/failures/${encodeURIComponent(failure)}/triage`, triage);
    } catch (error) {
      note(failure, before);
      setRefused({ failure, triage, error: error as Error });
    }
  };
  return { notes, refused, save, forgive: () => setRefused(null) };
}

interface DialogProps {
  campaign: string;
  failure: string;
  /** What was sent and refused, to begin with; else what the service has is read first. */
  refused: Refused | null;
  save: (triage: Note) => void;
  close: () => void;
}

export function TriageDialog({ campaign, failure, refused, save, close }: DialogProps) {
  const dialog = useRef<HTMLDialogElement>(null);
  const path = `v1/campaigns/${encodeURIComponent(campaign)}/failures/${encodeURIComponent(failure)}`;
  const asked = useAsked<{ triage: Triage | null }>(refused ? null : path);
  useLayoutEffect(() => dialog.current!.showModal(), []);
  const begun: Begun | undefined = refused?.triage ?? (asked.value && (asked.value.triage ?? { state: "new", comment: "" }));
  return (
    <dialog ref={dialog} class="card triage" aria-labelledby="triage-title" onClose={close} onClick={(event) => event.target === dialog.current && close()}>
      <h2 id="triage-title">Triage</h2>
      <p class="faint small">{failure}</p>
      {begun ? (
        <TriageForm begun={begun} error={refused?.error} save={save} close={close} />
      ) : asked.error ? (
        <Failed error={asked.error} again={asked.again} />
      ) : (
        <Loading what="what was noted" />
      )}
    </dialog>
  );
}

/** What the form begins with: when it was changed is known only of what the service has. */
type Begun = Note & Partial<Triage>;

function TriageForm({ begun, error, save, close }: { begun: Begun; error: Error | undefined; save: (triage: Note) => void; close: () => void }) {
  const [state, setState] = useState<TriageState>(begun.state);
  const [comment, setComment] = useState(begun.comment);
  const submit = (event: Event) => {
    event.preventDefault();
    save({ state, comment });
  };
  return (
    <form onSubmit={submit}>
      {error && (
        <p class="bad" role="alert">
          The note was not saved: {error instanceof TypeError ? "the service does not answer." : error.message}
        </p>
      )}
      <fieldset class="states">
        <legend>State</legend>
        {(Object.keys(TRIAGE) as TriageState[]).map((each) => (
          <label key={each} class="row">
            <input type="radio" name="state" value={each} checked={each === state} onChange={() => setState(each)} />
            {TRIAGE[each]}
          </label>
        ))}
      </fieldset>
      <label class="comment">
        Comment
        <textarea rows={5} maxLength={LONGEST} value={comment} onInput={(event) => setComment(event.currentTarget.value)} />
      </label>
      {begun.changed_at && <p class="faint small">Last changed {moment(begun.changed_at)}</p>}
      <div class="row">
        <button class="primary">Save</button>
        <button type="button" onClick={close}>
          Cancel
        </button>
      </div>
    </form>
  );
}
