"""Limits on checking an uploaded network and searching its places."""

CPU_S = 150  # a net of 50,000 edges takes 45
WALL_S = 300
LOG_BYTES = 64 << 10  # what the simulator may write to its log, and to any other file
OPEN_FILES = 64
SURVEY_S = 1800  # that a search for places may take; 50,000 edges take 150 on one core
SURVEY_MEMORY_BYTES = 4 << 30
MAX_PLACES = 100  # of a campaign
STEPS, STEP_S = 3, 0.1  # that the simulator runs
