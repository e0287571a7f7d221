"""A campaign's report: comparison, tables and figures of its finished runs.

    runs = [read_run(folder) for folder in folders]
    comparison = compare(spec, runs, command)
    write_report(comparison, folder)        # table.json, table.md, table.csv, figures/
    table_markdown(comparison); figure_bytes(comparison, "ecr_low", "svg")

Loads neither torch nor libsumo, so that a server can do it too.
"""

from risk_sac.report.comparison import Comparison, MissingRun, compare
from risk_sac.report.figures import figure_bytes, figure_names
from risk_sac.report.files import table_csv, table_json, write_report
from risk_sac.report.rendering import table_markdown
from risk_sac.report.runs import FinishedRun, read_run
from risk_sac.report.statistics import PairedTest
