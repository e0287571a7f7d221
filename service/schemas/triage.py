"""What people make of a failure."""

from datetime import datetime
from typing import Annotated

from pydantic import Field

from risk_sac.config.base import Settings
from service.schemas.base import Body
from service.store.states import TriageState

# Text of any language, with tabs and new lines: other control characters are not shown, or do what nobody sees.
TEXT = r"^[^\x00-\x08\x0b\x0c\x0e-\x1f\x7f]*$"


class PostedTriage(Settings):
    """What to note of a failure."""

    state: TriageState
    """new: nobody has decided; confirmed: the ego is to be mended; dismissed: it is not; fixed: it has been."""
    comment: Annotated[str, Field(max_length=2000, pattern=TEXT)] = ""
    """Why; plain text, which is shown as it is."""


class Triage(Body):
    """What people made of a failure."""

    state: TriageState
    comment: str
    changed_at: datetime
