"""The learners: soft actor-critic, replay, dual variable, and the control that learns nothing."""
