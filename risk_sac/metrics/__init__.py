"""Computes ECR, PCR, ES, ρ̄_c and OFD with 95 % intervals, and the records' digest.

A figure is a row of `rows`: its names, its formula, and how runs are pooled. `tally` counts what formulas take.

Source: RISK-SAC, Sec. IV (evaluation metrics); what the paper leaves open is marked as a choice.
"""

from risk_sac.metrics.accumulator import MetricsAccumulator, results_digest
from risk_sac.metrics.features import FEATURES, outcome_features
from risk_sac.metrics.intervals import RESAMPLING_SEED, bootstrap_interval, clopper_pearson, wilson_interval
from risk_sac.metrics.metric import (
    Estimate,
    Metric,
    Ratio,
    estimate,
    headline_driven_by,
    mean_over_runs,
    pcr_by_driver,
    pooled_bins,
    pooled_counts,
    pooled_headline,
    pooled_names,
)
from risk_sac.metrics.requirements import COLUMNS, pooled_requirements, requirement_cells
from risk_sac.metrics.rows import METRICS, RATIOS, MetricName
from risk_sac.metrics.tally import WINDOW, Tally, preventable
