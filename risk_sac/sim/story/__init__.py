"""Story of a scenario document, played within the step; independent of SUMO."""
