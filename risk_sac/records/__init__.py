"""Records of runs and of the service: one frozen model per thing.

A record is stored as JSON, answered by the service and read by the client; a field is declared once, here.
"""

from risk_sac.records.base import Adjustment, FieldProblem, Least, Page, Real, Record, stored, wire
from risk_sac.records.campaign import (
    Campaign,
    CampaignCheck,
    CampaignHead,
    CampaignPage,
    CampaignSummary,
    DefectPower,
    EndNotice,
    MethodPower,
    Power,
    Progress,
    Results,
    RunBudget,
    StateChange,
    Total,
)
from risk_sac.records.episode import (
    PHASES,
    Ending,
    Episode,
    EpisodeId,
    EpisodePage,
    EpisodeRecord,
    Failure,
    FailureOrder,
    Outcome,
    Phase,
    Repetition,
    SeriesFile,
    StoryDeviation,
    Triage,
    TriageState,
)
from risk_sac.records.judgement import (
    GAINS_MPS,
    BehaviourFact,
    ConflictType,
    EgoPart,
    Fault,
    Grade,
    Judgement,
    Plausibility,
    PlausibilityClass,
    ReferenceOutcome,
    Severity,
)
from risk_sac.records.run import (
    FINAL,
    Counts,
    DrivenBy,
    DriverPcr,
    Funnel,
    RequirementCounts,
    Run,
    RunMetrics,
    RunResult,
    RunSummary,
    State,
)
from risk_sac.records.violation import (
    ARTEFACT_RULES,
    NO_CONTACT,
    PUBLISHED,
    REPEATS,
    Collision,
    RequirementResult,
    Violation,
    valid_violations,
    worst_of,
)
