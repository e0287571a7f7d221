/** A strip for each run over its episodes, coloured by what drove them. */

import { DRIVEN_BY, drivenSummary, drivenWords } from "../../ui/driven";
import type { Curve } from "./curves";
import { drivenSoFar, shares } from "./driven";

interface Props {
  curves: Curve[];
  nameOf: (curve: Curve) => string;
}

export function Strips({ curves, nameOf }: Props) {
  const known = curves.filter(({ driven_by }) => Object.keys(driven_by).length > 0);
  if (known.length === 0) return null;
  const most = Math.max(...known.map(({ episodes }) => episodes.at(-1) ?? 0));
  const drove = DRIVEN_BY.filter((by) => known.some(({ driven_by }) => by in driven_by));
  return (
    <section class="card curve strips" aria-label="Driven by">
      <header>
        <h3>Driven by</h3>
        <span class="faint small">what drove the adversaries of each episode</span>
        <span class="strip-legend small">
          {drove.map((by) => (
            <span key={by}>
              <i class={`drove-${by}`} /> {drivenWords(by)}
            </span>
          ))}
        </span>
      </header>
      <div class="strip-rows" tabIndex={0} role="region" aria-label="Runs by what drove their episodes">
        {known.map((curve) => (
          <div key={curve.run_id} class="strip" data-run={curve.run_id}>
            <span class="small">{nameOf(curve)}</span>
            <Strip curve={curve} most={most} />
          </div>
        ))}
      </div>
    </section>
  );
}

function Strip({ curve, most }: { curve: Curve; most: number }) {
  const said = drivenSummary(drivenSoFar(curve.driven_by));
  return (
    <svg viewBox={`0 0 ${most} 1`} preserveAspectRatio="none" role="img" aria-label={said}>
      <title>{said}</title>
      {shares(curve).map(([by, outline]) => (
        <path key={by} class={`drove-${by}`} d={outline} />
      ))}
    </svg>
  );
}
