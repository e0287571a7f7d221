"""Makes the sentences of a verdict from its record; the page's `ui/verdicts.ts` says the same."""

from risk_sac.records import Collision, EgoPart, Violation

FULL_BRAKING, TTC_RULE = "full_braking", "r157_ttc"
DRIVERS = {
    "r157": "R157's driver",
    "fsm": "the fuzzy safety model",
    "rss": "the RSS driver",
    "defensive": "the defensive driver",
    FULL_BRAKING: "full braking at once",
    TTC_RULE: "R157's time-to-collision rule",
}


def prevented_by(violation: Collision | Violation) -> str | None:
    """Returns, e.g., "the RSS driver would have prevented it"; None where no reference driver was asked."""
    if not violation.prevention:
        return None
    names = [name for name, prevents in violation.prevention.items() if prevents and name != TTC_RULE]
    by_rule = f"; by {DRIVERS[TTC_RULE]} it is preventable" if violation.prevention.get(TTC_RULE) else ""
    if names == [FULL_BRAKING]:
        return f"of the reference drivers, only {DRIVERS[FULL_BRAKING]} would have prevented it{by_rule}"
    told = [DRIVERS.get(name, f"the {name.replace('_', ' ')} driver") for name in names]
    *first, last = told or ["none of the reference drivers"]
    told_of = f"{', '.join(first)} and {last}" if first else last
    return f"{told_of} would have prevented it{by_rule}"


def known(collision: Collision) -> str:
    """Says for how long the striker had been in the ego's view.

    It follows the striker's name: "which had been in its view for 1.0 s". What a defect keeps from the ego counts too.
    """
    seen_s = collision.visible_for_s
    if collision.judgement.hidden:
        if seen_s > 0.0:
            return f"which came into its view only {seen_s:.1f} s before"
        return "which was not in its view when the conflict began, nor then"
    if seen_s > 0.0:
        return f"which had been in its view for {seen_s:.1f} s"
    return "which was not in its view then, but when the conflict began"


def began(collision: Collision) -> str:
    """Returns when the conflict began; one that began hidden counts from when the ego could know of it."""
    before_s = collision.time_s - collision.judgement.conflict_s
    if not collision.judgement.hidden:
        return f"the conflict began {before_s:.1f} s before the contact"
    if collision.visible_for_s <= 0.0:
        return "the conflict was hidden until the contact"
    return f"the conflict began in hiding and came into sight {before_s:.1f} s before the contact"


def ego_did(part: EgoPart) -> str:
    """Returns, e.g., "braked 1.1 s after the conflict began, by 4.0 of 7.6 m/s²"; it follows "the ego"."""
    told = [_braked(part)]
    gained = f"gained {part.gained_mps:.1f} m/s" if part.sped_up else ""
    if part.started or part.sped_up:
        told.append(" and ".join(filter(None, ("drove on" * part.started, gained))) + " though it saw the striker")
    if part.too_fast:
        told.append(f"drove at {part.sighted_mps:.1f} m/s where its sight allowed {part.sight_mps:.1f} m/s")
    if part.left_first == "ego":
        told.append("was the first to leave RSS's proper response")
    return "; it ".join(told)


def _braked(part: EgoPart) -> str:
    if part.braked_after_s is None:
        return "did not brake in the conflict"
    if part.braked_after_s == 0.0:
        when = "was braking when the conflict began"
    else:
        when = f"braked {part.braked_after_s:.1f} s after the conflict began"
    return f"{when}, by {part.braking_mps2:.1f} of {part.possible_mps2:.1f} m/s²"
