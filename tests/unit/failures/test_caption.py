from risk_sac.failures.recording import Recording
from risk_sac.failures.show import draw_recording
from tests.unit.failures.staged import JUDGED, synthetic_contact, with_release


def test_the_title_says_who_would_have_prevented_it_and_what_the_striker_broke() -> None:
    figure = draw_recording("mixed", Recording(synthetic_contact(), with_release()))
    assert figure.get_suptitle().splitlines()[2:] == [
        "grade careful · pedestrian from 1.2 s before the contact, 0.8 s after the release, at (302.0, -3.2) m",
        "the striker broke pedestrian on red",
    ]
    nothing = JUDGED.model_copy(update={"grade": None, "broke": ()})
    title = draw_recording("mixed", Recording(synthetic_contact(nothing), with_release())).get_suptitle()
    assert title.splitlines()[2].startswith("no grade · pedestrian from")
    assert title.endswith("the striker broke nothing")
