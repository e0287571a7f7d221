/** Scenarios wherever they are named: name, summary and a small picture. */

import { Fragment } from "preact";
import { useEffect, useRef, useState } from "preact/hooks";
import { get } from "../api/client";
import { queue } from "../api/turn";
import type { Body } from "../api/types";
import { address } from "../router";
import { signal, useSignal } from "../signal";
import { useThumbnail } from "./thumbnails";
import "./scenario.css";

type Summary = Body<"ScenarioSummary">;

const drawing = queue(); // the service draws two at once

export function pathOf(name: string): string {
  return `v1/scenarios/${encodeURIComponent(name)}`;
}

/** The picture's address; null while it loads, empty where there is none. */
export function useScenarioPicture(name: string): string | null {
  return useThumbnail(`${pathOf(name)}/picture.png`, drawing);
}

/** The picture of a scenario, requested when it comes into view. */
export function ScenarioPicture({ name }: { name: string }) {
  const frame = useRef<HTMLSpanElement>(null);
  const [seen, setSeen] = useState(false);
  useEffect(() => {
    const watch = new IntersectionObserver(([entry]) => entry!.isIntersecting && setSeen(true), { rootMargin: "200px" });
    watch.observe(frame.current!);
    return () => watch.disconnect();
  }, []);
  return (
    <span ref={frame} class="scenario-frame">
      {seen && <Drawn name={name} />}
    </span>
  );
}

function Drawn({ name }: { name: string }) {
  const url = useScenarioPicture(name);
  if (url) return <img src={url} alt="" />;
  return <span class="faint small">{url === null ? "Drawing …" : "No picture"}</span>;
}

/** Scenarios that the service has, by name; places of a map are not among them. */
const known = signal<ReadonlyMap<string, Summary>>(new Map());
const asked = new Set<string>();

/** Names of scenarios, each with its picture and its summary as a hint. */
export function ScenarioNames({ names }: { names: readonly string[] }) {
  const scenarios = useSignal(known);
  useEffect(() => {
    const missing = names.filter((name) => !scenarios.has(name) && !asked.has(name));
    if (missing.length === 0) return;
    missing.forEach((name) => asked.add(name)); // once: a place of a map stays unknown
    get<Body<"ScenarioList">>("v1/scenarios").then(
      ({ items }) => known.set(new Map(items.map((item) => [item.name, item]))),
      () => missing.forEach((name) => asked.delete(name)),
    );
  }, [names.join()]);
  return (
    <span class="scenario-names">
      {names.map((name, at) => (
        <Fragment key={name}>
          <span class="scenario-name">
            <Named name={name} scenario={scenarios.get(name)} />
            {at < names.length - 1 && ","}
          </span>{" "}
        </Fragment>
      ))}
    </span>
  );
}

function Named({ name, scenario }: { name: string; scenario: Summary | undefined }) {
  if (!scenario) return <>{name}</>;
  return (
    <a href={address(["scenarios", name])} title={scenario.summary}>
      <ScenarioPicture name={name} />
      {name}
    </a>
  );
}
