"""Draws the critical-difference diagram of methods over defects.

Methods that a bar connects do not differ significantly (Nemenyi test at 5 % after a Friedman test).
Source: Demšar 2006, "Statistical comparisons of classifiers over multiple data sets".
"""

from collections.abc import Sequence

from matplotlib.figure import Figure

from risk_sac.canvas import canvas
from risk_sac.config import RunMethod
from risk_sac.report.drawing import LOOKS
from risk_sac.types import Floats

PACKAGE, REMEDY = "scikit_posthocs", "for the diagram, pip install 'risk-sac[benchmark]'"
SIZE_IN = (6.4, 2.2)


def diagram(methods: Sequence[RunMethod], means: Floats) -> Figure:
    """Draws the mean ranks of the methods, 1 being the quickest.

    Args:
      methods: at least three.
      means: restricted mean steps to detection, `defects x methods`.
    """
    import scikit_posthocs
    from scipy.stats import rankdata

    ranks = dict(zip(methods, rankdata(means, axis=1).mean(axis=0), strict=True))
    p_values = scikit_posthocs.posthoc_nemenyi_friedman(means)
    p_values.index = p_values.columns = list(methods)
    figure = canvas(SIZE_IN)
    axes = figure.add_subplot()
    colours = {method: LOOKS[method].colour for method in methods}
    scikit_posthocs.critical_difference_diagram(ranks, p_values, ax=axes, color_palette=colours)
    axes.set_title("mean rank of steps to detection over defects", fontsize=9)
    return figure
