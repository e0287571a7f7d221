/** Pictures on buttons, since not every font has the signs. */

const SHAPES = {
  first: "M3 2v12M13 2 5 8l8 6z",
  back: "M11 2 4 8l7 6z",
  on: "M5 2l7 6-7 6z",
  last: "M13 2v12M3 2l8 6-8 6z",
};

export function Icon({ name }: { name: keyof typeof SHAPES }) {
  return (
    <svg class="icon" width="14" height="14" viewBox="0 0 16 16" aria-hidden="true">
      <path d={SHAPES[name]} fill="currentColor" stroke="currentColor" stroke-width="1.6" stroke-linejoin="round" />
    </svg>
  );
}
