/** The reference against the other methods, runs paired by seed. */

import type { Body } from "../../api/types";
import { number } from "../../ui/text";
import { Interval } from "./interval";

type Test = Body<"PairedTest">;
const LEVEL = 0.05;

const WORDS: Record<string, string> = {
  ecr: "ECR",
  pcr: "PCR",
  es: "ES",
  rho_c: "ρ̄_c",
  ofd: "OFD",
  distinct_per_1000_steps: "distinct / 1000 steps",
  preventable_per_1000_steps: "preventable / 1000 steps",
};

interface Tested {
  tests: Test[];
  family: string;
  reference: string;
  caption: string;
}

export function Tests({ tests, family, reference, caption }: Tested) {
  if (!tests.length) return null;
  const tested = tests.some((test) => test.p !== null);
  const table = <TestTable tests={tests} caption={`${caption}: ${family}`} />;
  if (tested) {
    return (
      <section class="block">
        <h3>{caption}</h3>
        {table}
      </section>
    );
  }
  return (
    <section class="block">
      <h3>{caption}</h3>
      <p class="faint">
        {tests.some((test) => test.pairs)
          ? `Nothing can be tested: ${reference} and another method need two seeds in common.`
          : "Nothing can be tested: too few runs have searched for so long."}
      </p>
      {tests.some((test) => test.difference !== null) && (
        <details>
          <summary>Differences without a test</summary>
          {table}
        </details>
      )}
    </section>
  );
}

function TestTable({ tests, caption }: { tests: Test[]; caption: string }) {
  return (
    <div class="scroll" tabIndex={0} role="region" aria-label={caption}>
      <table class="tests">
        <thead>
          <tr>
            <th scope="col">Measure</th>
            <th scope="col">Against</th>
            <th scope="col" class="rate">Difference, 95 % interval</th>
            <th scope="col" class="number" title="Chance that a run of the reference has the larger value; 0.5 is no difference">A12</th>
            <th scope="col" class="number" title="Wilcoxon signed-rank, two-sided">p</th>
            <th scope="col" class="number" title="Corrected over what was declared beforehand, or over all the rest">p (Holm)</th>
            <th scope="col" class="number">Pairs</th>
          </tr>
        </thead>
        <tbody>
          {tests.map((test) => (
            <TestRow key={`${test.metric} ${test.method}`} test={test} room={room(tests, test.metric)} />
          ))}
        </tbody>
      </table>
    </div>
  );
}

function TestRow({ test, room }: { test: Test; room: number }) {
  const { difference, low, high, p_holm } = test;
  const significant = p_holm !== null && p_holm < LEVEL;
  const text = difference === null ? "–" : `${signed(difference)}${low === null || high === null ? "" : ` [${signed(low)}, ${signed(high)}]`}`;
  return (
    <tr class={significant ? "significant" : ""}>
      <th scope="row">{WORDS[test.metric] ?? test.metric}</th>
      <td>{test.method}</td>
      <td class="rate">
        <span class="rate-text">{text}</span>
        <Interval estimate={{ mean: difference, low, high }} from={-room} to={room} label={`Difference to ${test.method}: ${text}`} />
      </td>
      <td class="number">{number(test.a12)}</td>
      <td class="number">{number(test.p, 3)}</td>
      <td class="number">
        {number(p_holm, 3)}
        {significant && <span class="tag">significant</span>}
      </td>
      <td class="number">{test.pairs}</td>
    </tr>
  );
}

/** Half the width of a measure's axis, the same for all methods. */
function room(tests: Test[], metric: string): number {
  const reached = tests.filter((test) => test.metric === metric).flatMap(({ difference, low, high }) => [difference ?? 0, low ?? 0, high ?? 0]);
  return 1.05 * Math.max(...reached.map(Math.abs)) || 1;
}

function signed(value: number): string {
  return `${value < 0 ? "−" : "+"}${Math.abs(value).toFixed(3)}`;
}
