/** What a newcomer sees: a picture of a result, and the three steps to one. */

import picture from "../../../replay.png";

export function FirstSteps() {
  return (
    <section class="card first">
      <div>
        <h1>Find out how your ego fails</h1>
        <p>The service plays scenarios against an ego until it fails, and shows which failures are plausible and preventable.</p>
        <ol>
          <li>
            <b>Choose an ego.</b> One of SUMO's drivers, a planner that ships with it, or <a href="#/new">your own by its name</a>.
          </li>
          <li>
            <b>Choose scenarios.</b> A pedestrian behind a van, a cut-in on a motorway: <a href="#/scenarios">see all with pictures</a>.
          </li>
          <li>
            <b>Choose the effort.</b> A quick look takes a minute or so. Then watch each failure, with its verdict.
          </li>
        </ol>
        <a class="button primary" href="#/new">
          Start the first campaign
        </a>
      </div>
      <img src={picture} width="1280" height="720" alt="A replay: a pedestrian steps out from behind a vehicle into the ego's way, beside the verdict on the contact" />
    </section>
  );
}
