"""ECR, PCR, ES, ρ̄_c and OFD with intervals, and the records' digest.

A figure is a row of `rows`: its names, its formula, and how runs are pooled. `tally` counts what formulas take.

Source: RISK-SAC, Sec. IV (evaluation metrics); what the paper leaves open is marked as a choice.
"""

from risk_sac.metrics.metric import (
    FEATURES,
    RESAMPLING_SEED,
    Estimate,
    Metric,
    Ratio,
    bootstrap_interval,
    clopper_pearson,
    estimate,
    headline_driven_by,
    mean_over_runs,
    outcome_features,
    pcr_by_driver,
    pooled_bins,
    pooled_counts,
    pooled_headline,
    pooled_names,
    pooled_published,
    wilson_interval,
)
from risk_sac.metrics.rows import METRICS, RATIOS, MetricName, MetricsAccumulator, ResultsDigest, results_digest
from risk_sac.metrics.tally import (
    COLUMNS,
    WINDOW,
    Tally,
    pooled_requirements,
    preventable,
    published,
    requirement_cells,
    with_published,
)
