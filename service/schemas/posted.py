"""Bodies that clients send, beside campaigns."""

from typing import Annotated

from pydantic import Field

from risk_sac.config import EgoConfig
from risk_sac.config.base import Settings
from risk_sac.records import TriageState

# Text of any language, with tabs and new lines; other control characters could hide or reorder what is shown.
TEXT = r"^[^\x00-\x08\x0b\x0c\x0e-\x1f\x7f]*$"


class PostedRegression(Settings):
    """What to play against what."""

    campaign_id: Annotated[str, Field(max_length=100, pattern=r"^[A-Za-z0-9]+$")]
    """Whose distinct failures; it has ended."""
    ego: EgoConfig
    """The other ego, such as `{"profile": "careful"}`."""


class PostedTriage(Settings):
    """What to note of a failure."""

    state: TriageState
    """new: nobody has decided; confirmed: the ego is to be mended; dismissed: it is not; fixed: it has been."""
    comment: Annotated[str, Field(max_length=2000, pattern=TEXT)] = ""
    """Why; plain text, which is shown as it is."""
