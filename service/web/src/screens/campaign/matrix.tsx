/** Cells of two scene parameters: how often each was played, and how often it failed. */

import type { Body } from "../../api/types";
import { count } from "../../ui/text";
import { titleOf } from "../new/schema";
import { cellsOf, type Cell } from "./cells";

interface Asked {
  family: Body<"FamilySceneEffects">;
  rows: string;
  columns: string;
}

export function Matrix({ family, rows, columns }: Asked) {
  const cells = cellsOf(family, rows, columns);
  if (cells === null) return <p class="faint">Choose two different parameters.</p>;
  return <CellTable of={[rows, columns]} bins={[binsOf(family, rows), binsOf(family, columns)]} cells={cells} />;
}

interface Table {
  /** The two parameters. */
  of: [rows: string, columns: string];
  bins: [rows: readonly string[], columns: readonly string[]];
  cells: Cell[][];
}

/** How often each cell of two parameters was played, and failed. */
export function CellTable({ of: [rows, columns], bins, cells }: Table) {
  const every = cells.flat();
  const [played, failed] = [every.filter((cell) => cell.played), every.filter((cell) => cell.failed)];
  return (
    <>
      <p class="small faint" role="status">
        {count(played.length)} of {count(every.length)} cells were played, {count(failed.length)} had a failure. A cell shows failures of
        episodes; a dash: never played.
      </p>
      <div class="scroll" tabIndex={0} role="region" aria-label="Coverage of two parameters">
        <table class="matrix">
          <thead>
            <tr>
              <th class="corner">
                {axis(rows)} ↓ · {axis(columns)} →
              </th>
              {bins[1].map((bin) => (
                <th key={bin} scope="col">
                  {bin}
                </th>
              ))}
            </tr>
          </thead>
          <tbody>
            {bins[0].map((bin, i) => (
              <tr key={bin}>
                <th scope="row">{bin}</th>
                {cells[i]!.map((cell, j) => (
                  <td key={j} class={lookOf(cell)}>
                    {cell.played ? (
                      <>
                        <b>{cell.failed}</b> of {cell.played}
                      </>
                    ) : (
                      "–"
                    )}
                  </td>
                ))}
              </tr>
            ))}
          </tbody>
        </table>
      </div>
    </>
  );
}

const LOOKS = ["safe", "failed-some", "failed-many", "failed-most"] as const;

function lookOf({ played, failed }: Cell): string {
  if (!played) return "never";
  const rate = failed / played;
  return LOOKS[failed === 0 ? 0 : rate < 0.2 ? 1 : rate < 0.5 ? 2 : 3];
}

function binsOf({ parameters }: Asked["family"], name: string): string[] {
  return parameters.find((parameter) => parameter.name === name)!.bins;
}

function axis(name: string): string {
  const [title, unit] = titleOf(name);
  return unit ? `${title}, ${unit}` : title;
}
