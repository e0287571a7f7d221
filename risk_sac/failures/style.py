"""What the parts of a contact's picture share."""

from matplotlib.axes import Axes

EGO_COLOUR, OTHER_COLOUR, BYSTANDER_COLOUR = "tab:blue", "tab:red", "tab:gray"
SEEN_COLOUR, CONFLICT_COLOUR, RELEASE_COLOUR = "tab:green", "tab:orange", "tab:purple"  # of instants
HIDDEN_COLOUR = "0.9"


def legend(axis: Axes, title: str | None = None) -> None:
    """Beside the axes, so that it covers nothing."""
    axis.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=7, frameon=False, title=title, title_fontsize=7)
