"""Evidence of a campaign with its limits: failure rates, coverage and report.

evidence = gathered(comparison)                      # bounds and coverage, as data
document = report(comparison, evidence, origin, power)
html(document); markdown(document)
"""

from risk_sac.report.evidence.document import POLICY, html, markdown
from risk_sac.report.evidence.gathered import Evidence, gathered
from risk_sac.report.evidence.origin import Origin, show_command
from risk_sac.report.evidence.report import report
