"""The GIF, read by Pillow."""

import numpy as np
import pytest
from PIL import Image, ImageColor

from risk_sac.failures.export.formats import FormatName
from risk_sac.failures.export.gif import EGO, HOLD_MS, LAST_S, STRIKER
from tests.exports.make_examples import FAMILIES


@pytest.mark.parametrize("family", FAMILIES)
def test_it_shows_ego_and_striker_up_to_the_contact(family, exported, failure):
    with Image.open(exported(family, FormatName.GIF)) as animation:
        frames = animation.n_frames
        assert frames == min(failure(family).frames, round(LAST_S * 10))
        assert failure(family).name in animation.info["comment"].decode()
        durations, blue = [], 0
        for frame in range(frames):
            animation.seek(frame)
            durations.append(animation.info["duration"])
            blue += (np.asarray(animation.convert("RGB")) == ImageColor.getrgb(EGO)).all(axis=-1).sum() > 100
        assert durations == [100] * (frames - 1) + [HOLD_MS]
        assert blue == frames  # the ego is in every picture
        last = np.asarray(animation.convert("RGB"))
        assert (last == ImageColor.getrgb(STRIKER)).all(axis=-1).sum() > 15
