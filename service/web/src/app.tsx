/** The shell: what stands around every screen, and which screen is shown. */

import type { ComponentChildren } from "preact";
import { useEffect, useErrorBoundary, useState } from "preact/hooks";
import { useAlive } from "./api/alive";
import { absolute, connected, hasKey, setKey, wantsKey } from "./api/client";
import { placeOf, usePlace, type Place } from "./router";
import { CampaignScreen } from "./screens/campaign/screen";
import { CampaignsScreen } from "./screens/campaigns/screen";
import { CompareScreen } from "./screens/compare/screen";
import { CoverageScreen } from "./screens/coverage/screen";
import { FailuresScreen } from "./screens/failures/screen";
import { HomeScreen } from "./screens/home/screen";
import { MapScreen } from "./screens/maps/map";
import { MapsScreen } from "./screens/maps/screen";
import { NewScreen } from "./screens/new/screen";
import { PairScreen } from "./screens/pair/screen";
import { ReplayScreen } from "./screens/replay/screen";
import { EditorScreen } from "./screens/scenarios/editor";
import { ScenarioScreen } from "./screens/scenarios/one";
import { ScenariosScreen } from "./screens/scenarios/screen";
import { TrendScreen } from "./screens/trend/screen";
import { WorkersScreen } from "./screens/workers/screen";
import { useSignal } from "./signal";
import { Login } from "./ui/login";
import { Empty } from "./ui/states";
import { ThemeButton } from "./ui/theme";
import { useTitle } from "./ui/title";

export function App() {
  const place = usePlace();
  const keyWanted = useSignal(wantsKey);
  const lost = !useSignal(connected);
  useFocusOnArrival(place);
  useAlive();
  return (
    <>
      <header class="bar">
        <a class="skip" href={location.hash || "#/"} onClick={toContent}>
          Skip to content
        </a>
        <a class="brand" href="#/">
          RISK-SAC
        </a>
        <nav aria-label="Main">
          <Tab to="#/">Egos</Tab>
          <Tab to="#/campaigns">Campaigns</Tab>
          <Tab to="#/new">New campaign</Tab>
          <Tab to="#/scenarios">Scenarios</Tab>
          <Tab to="#/maps">Maps</Tab>
          <Tab to="#/compare">Compare</Tab>
          <Tab to="#/trend">Versions</Tab>
          <Tab to="#/coverage">Coverage</Tab>
          <Tab to="#/workers">Workers</Tab>
          <a href={absolute("docs")}>API</a>
        </nav>
        <span class="bar-end">
          {hasKey() && <button onClick={() => setKey(null)}>Log out</button>}
          <ThemeButton />
        </span>
      </header>
      {lost && (
        <p class="banner" role="alert">
          The service does not answer. The page shows its last answers and asks again every two seconds.
        </p>
      )}
      <main id="content" tabIndex={-1}>
        {keyWanted ? <Login /> : <Guarded key={place.parts.join("/")}>{screen(place)}</Guarded>}
      </main>
    </>
  );
}

/** Shows why a screen cannot be drawn, in its place. */
function Guarded({ children }: { children: ComponentChildren }) {
  const [error] = useErrorBoundary() as [Error | undefined, () => void];
  if (error === undefined) return <>{children}</>;
  return (
    <Empty>
      <p role="alert">This screen cannot be drawn: {error.message}. The page may be older than the service.</p>
      <button onClick={() => location.reload()}>Load the page again</button>
    </Empty>
  );
}

function screen({ parts, query }: Place): ComponentChildren {
  const [room, id, part, failure, twin, kind] = parts;
  if (room === undefined) return <HomeScreen />;
  if (room === "campaigns" && id === undefined) return <CampaignsScreen query={query} />;
  if (room === "new") return <NewScreen query={query} />;
  if (room === "scenarios" && part === undefined) {
    if (id === undefined) return <ScenariosScreen query={query} />;
    return id === "new" ? <EditorScreen query={query} /> : <ScenarioScreen name={id} key={id} />;
  }
  if (room === "maps" && part === undefined) return id === undefined ? <MapsScreen /> : <MapScreen id={id} query={query} key={id} />;
  if (room === "trend") return <TrendScreen query={query} />;
  if (room === "workers") return <WorkersScreen />;
  if (room === "coverage") return <CoverageScreen query={query} />;
  if (room === "compare") return <CompareScreen query={query} />;
  if (room === "campaigns" && id !== undefined) {
    if (part === undefined) return <CampaignScreen id={id} key={id} />;
    if (part === "compare") return <CompareScreen query={new URLSearchParams({ ids: id })} />;
    if (part === "coverage") return <CoverageScreen campaign={id} query={query} key={id} />;
    if (part === "failures" && failure === undefined) return <FailuresScreen campaign={id} query={query} key={id} />;
    if (part === "failures" && failure !== undefined) {
      if (twin === "twin") return <PairScreen campaign={id} failure={failure} twin={kind ?? "idle"} query={query} key={failure} />;
      return <ReplayScreen campaign={id} failure={failure} query={query} key={failure} />;
    }
  }
  return <Nowhere />;
}

function Nowhere() {
  useTitle("Nothing is here");
  return (
    <Empty>
      <h1>Nothing is here</h1>
      <p>
        <a href="#/campaigns">To the campaigns</a>
      </p>
    </Empty>
  );
}

function Tab({ to, children }: { to: string; children: ComponentChildren }) {
  const [room] = usePlace().parts;
  return (
    <a href={to} aria-current={placeOf(to).parts[0] === room ? "page" : undefined}>
      {children}
    </a>
  );
}

function toContent(event: Event): void {
  event.preventDefault();
  document.getElementById("content")!.focus();
}

/** A screen reader hears where it came to; nothing moves when only a filter changes. */
function useFocusOnArrival({ parts }: Place): void {
  const [first] = useState(parts.join("/"));
  useEffect(() => {
    if (parts.join("/") !== first) document.getElementById("content")!.focus({ preventScroll: true });
  }, [parts.join("/")]);
}
