import numpy as np
import pytest

from risk_sac.failures.recording import Recording
from risk_sac.failures.show import draw_recording
from tests.unit.failures.staged import JUDGED, synthetic_contact, with_release


@pytest.mark.parametrize("conflict_s", [0.75, -1.0])
def test_what_happens_is_marked_in_every_panel_and_the_conflict_from_above(conflict_s):
    contact = synthetic_contact(JUDGED.model_copy(update={"conflict_s": conflict_s}))
    view, *panels = draw_recording("mixed", Recording(contact, with_release())).axes
    assert len(panels) == 5
    for panel in panels:
        dotted, dashed = (
            [float(np.ravel(line.get_xdata())[0]) for line in panel.lines if line.get_linestyle() == style]
            for style in (":", "--")
        )
        assert dotted == pytest.approx([-0.95, -1.95, conflict_s - 1.95])
        assert 0.0 in dashed  # the contact
    (mark,) = (line for line in view.lines if line.get_marker() == "D")
    assert (np.ravel(mark.get_xdata())[0], np.ravel(mark.get_ydata())[0]) == (302.0, -3.25)
    ghosts = [patch for patch in view.patches if patch.get_linestyle() == "--"]
    centres = [patch.get_path().vertices[:-1].mean(axis=0) for patch in ghosts]
    pedestrian_y = -4 + max(conflict_s, 0)
    np.testing.assert_allclose(centres, [(280 + 10 * conflict_s, -1.65), (302, pedestrian_y)])
    low, high = view.get_xlim()
    assert low < 280 + 10 * conflict_s < high


def test_no_label_covers_another_nor_a_body():
    series, crowd = with_release(), 6
    several = {
        name: np.concatenate([values, *[values[..., -1:]] * crowd], axis=-1)
        for name, values in series.items()
        if values.shape and values.shape[-1] == len(series["ids"])
    }
    apart = np.concatenate((np.zeros(2), np.arange(crowd + 1) * 1.2))
    several["x_m"] = np.concatenate((several["x_m"][:, :2], np.full((len(several["x_m"]), crowd + 1), 290.0)), axis=1)
    several["y_m"], several["heading_rad"] = (np.nan_to_num(several[name]) for name in ("y_m", "heading_rad"))
    several["y_m"] = several["y_m"] + apart
    several["ids"] = np.array(["ego", "pedestrian", *(f"bystander_{k}" for k in range(crowd + 1))])
    figure = draw_recording("mixed", Recording(synthetic_contact(), series | several))
    figure.draw_without_rendering()
    view = figure.axes[0]
    boxes = [text.get_window_extent() for text in view.texts]
    assert {"bystander_0", "−1 s"} <= {text.get_text() for text in view.texts}
    assert not [1 for k, box in enumerate(boxes) for other in boxes[:k] if box.overlaps(other)]
    (ego,) = (patch.get_window_extent() for patch in view.patches if patch.get_label() == "ego")
    assert not [box for box in boxes if box.overlaps(ego)]
