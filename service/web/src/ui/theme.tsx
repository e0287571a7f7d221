/** Light or dark: as the system says, until the user chooses. */

import { useEffect, useState } from "preact/hooks";
import { signal, useSignal } from "../signal";

const CHOICE = "risk-sac-theme";
const system = matchMedia("(prefers-color-scheme: dark)");

/** Whether the page is dark now; canvases follow it, style sheets need not. */
export const dark = signal(chosen());

function chosen(): boolean {
  const choice = localStorage.getItem(CHOICE);
  return choice === null ? system.matches : choice === "dark";
}

function apply(): void {
  dark.set(chosen());
  document.documentElement.dataset.theme = dark.get() ? "dark" : "light";
}

apply();
system.addEventListener("change", apply);

export function ThemeButton() {
  const isDark = useSignal(dark);
  return (
    <button
      onClick={() => {
        localStorage.setItem(CHOICE, isDark ? "light" : "dark");
        apply();
      }}
    >
      {isDark ? "Light" : "Dark"}
    </button>
  );
}

/** A colour of the style sheet by its name, such as `--ego`; drawn anew when the theme changes. */
export function useColours<Name extends string>(names: readonly Name[]): Record<Name, string> {
  const isDark = useSignal(dark);
  const read = () => {
    const style = getComputedStyle(document.documentElement);
    return Object.fromEntries(names.map((name) => [name, style.getPropertyValue(name).trim()])) as Record<Name, string>;
  };
  const [colours, setColours] = useState(read);
  useEffect(() => setColours(read()), [isDark]);
  return colours;
}
