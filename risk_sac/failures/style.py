"""What the parts of a contact's picture share."""

from matplotlib.axes import Axes

EGO_COLOUR, OTHER_COLOUR, BYSTANDER_COLOUR = "tab:blue", "tab:red", "tab:gray"
SEEN_COLOUR, CONFLICT_COLOUR, RELEASE_COLOUR = "tab:green", "tab:orange", "tab:purple"  # of instants


def legend(axis: Axes) -> None:
    """Beside the axes, so that it covers nothing."""
    axis.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=7, frameon=False)
