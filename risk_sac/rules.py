"""Names of the rules by which a contact is no failure; `risk_sac.verdicts` has what they ask."""

REPEATS = "repeats"  # failed by what was replayed and went another way, and by its like; asked of nothing else
# The rules, among a collision's verdicts, that speak of the simulator or the control and not of who is to blame.
ARTEFACT_RULES = frozenset(
    {
        REPEATS,
        "no_teleport",
        "no_spawn_overlap",
        "conflict_after_release",
        "inside_limits",
        "inside_grip",
        "solid_bodies",
        "ego_model_saw",
    }
)
